"""A WebSocket (RFC 6455) as the server sees it, for messages of one binary frame.

Libraries pass each message through a state machine, which takes as long as a step.
"""

from __future__ import annotations

import base64
import contextlib
import hashlib
import socket
import time

_GUID = "258EAFA5-E914-47DA-95CA-C5AB0DC85B11"

_TEXT, _BINARY, _CLOSE, _PING, _PONG = 1, 2, 8, 9, 10
_LAST, _MASKED, _SIZE = 0x80, 0x80, 0x7F
_LARGEST_CONTROL = 125

# The codes of RFC 6455 for the end of a connection, and one of this server's own.
GOING_AWAY, PROTOCOL_ERROR, UNSUPPORTED, TOO_LARGE, TAKEN_OVER = 1001, 1002, 1003, 1009, 4001

_RECEIVE_BYTES = 2**16

# A client that broke the protocol gets this long to read why, in seconds.
_LINGER_SECONDS = 1.0


class ProtocolError(Exception):
    """What a client sent that ends the connection.

    Attributes:
        code: the code of the close frame.
    """

    def __init__(self, code: int, reason: str) -> None:
        super().__init__(reason)
        self.code = code


def accept_key(key: str) -> str:
    """Return the header Sec-WebSocket-Accept for a client's Sec-WebSocket-Key."""
    digest = hashlib.sha1((key + _GUID).encode("latin-1"), usedforsecurity=False).digest()
    return base64.b64encode(digest).decode("ascii")


class WebSocket:
    """One connection after its upgrade."""

    def __init__(self, client: socket.socket, rest: bytes, most_bytes: int) -> None:
        """Take over a socket.

        Args:
            client: the socket, which blocks without a timeout.
            rest: what the client has sent since its request.
            most_bytes: the size of the largest message.
        """
        self._socket = client
        self._rest = rest
        self._most_bytes = most_bytes

    def receive(self) -> bytes | None:
        """Return the next message, None at the end; answer pings.

        Raises:
            ProtocolError: the client sent something else.
        """
        while True:
            data = self._at_least(2, self._rest)
            if data is None:
                return None
            first, second = data[0], data[1]
            size, at = second & _SIZE, 2
            if first != _LAST | _BINARY or not second & _MASKED:
                _check(first, second)
            if size > _LARGEST_CONTROL:
                at = 4 if size == _LARGEST_CONTROL + 1 else 10
                data = self._at_least(at, data)
                if data is None:
                    return None
                size = int.from_bytes(data[2:at], "big")
            if size > self._most_bytes:
                raise ProtocolError(TOO_LARGE, f"a message has at most {self._most_bytes} bytes")
            begin, end = at + 4, at + 4 + size
            data = self._at_least(end, data)
            if data is None:
                return None
            self._rest = data[end:]
            content = _unmasked(data[at:begin], data[begin:end])
            match first & 0x0F:
                case 0x02:
                    return content
                case 0x08:
                    self._send_frame(_CLOSE, content[:2])
                    return None
                case 0x09:
                    self._send_frame(_PONG, content)

    def _at_least(self, size: int, data: bytes) -> bytes | None:
        """Return these bytes and what follows, at least so many; None at the end."""
        if len(data) >= size:
            return data
        if not data:
            data = self._socket.recv(_RECEIVE_BYTES)
            if len(data) >= size or not data:
                return data or None
        whole = bytearray(data)
        while len(whole) < size:
            more = self._socket.recv(_RECEIVE_BYTES)
            if not more:
                return None
            whole += more
        return bytes(whole)

    def send(self, message: bytes) -> None:
        """Send a binary message."""
        self._send_frame(_BINARY, message)

    def send_text(self, message: bytes) -> None:
        """Send a message of text in UTF-8."""
        self._send_frame(_TEXT, message)

    def _send_frame(self, opcode: int, content: bytes) -> None:
        size = len(content)
        if size <= _LARGEST_CONTROL:
            head = bytes((_LAST | opcode, size))
        elif size < 2**16:
            head = bytes((_LAST | opcode, 126)) + size.to_bytes(2, "big")
        else:
            head = bytes((_LAST | opcode, 127)) + size.to_bytes(8, "big")
        self._socket.sendall(head + content)

    def close(self, code: int, reason: str) -> None:
        """End the connection in words, which the client can still read."""
        with contextlib.suppress(OSError):
            self._send_frame(_CLOSE, code.to_bytes(2, "big") + reason.encode()[:120])
            # Closing a socket with unread bytes would discard these words.
            self._socket.shutdown(socket.SHUT_WR)
            end = time.monotonic() + _LINGER_SECONDS
            self._socket.settimeout(_LINGER_SECONDS)
            while time.monotonic() < end and self._socket.recv(_RECEIVE_BYTES):
                pass


def _check(first: int, second: int) -> None:
    """Refuse a frame that is no whole binary message, and no control frame."""
    opcode = first & 0x0F
    if first & 0x70 or opcode not in (0, _TEXT, _BINARY, _CLOSE, _PING, _PONG):
        raise ProtocolError(PROTOCOL_ERROR, "the frame has a bit or an opcode that means nothing")
    if not second & _MASKED:
        raise ProtocolError(PROTOCOL_ERROR, "a client must mask its frames")
    if opcode == _TEXT:
        raise ProtocolError(UNSUPPORTED, "a message must be binary, not text")
    if opcode == 0 or not first & _LAST:
        raise ProtocolError(UNSUPPORTED, "a message must be one frame, not several")
    if opcode >= _CLOSE and second & _SIZE > _LARGEST_CONTROL:
        raise ProtocolError(PROTOCOL_ERROR, "a control frame has at most 125 bytes")


def _unmasked(mask: bytes, content: bytes) -> bytes:
    if mask == b"\0\0\0\0":
        return content
    size = len(content)
    key = int.from_bytes((mask * (size // 4 + 1))[:size], "little")
    return (int.from_bytes(content, "little") ^ key).to_bytes(size, "little")
