"""A client of streams, on a bare socket. For tests."""

import json
import socket
import struct
import urllib.parse

import raw_http

REQUEST = struct.Struct("<BBHxxxxd")
ANSWER = struct.Struct("<BxHIxxxxd")
STEP, RESET = 0, 1
ARRAYS, JSON_BODY, TENSOR_BODY = 0, 1, 2


def upgrade(path, *headers):
    """Return the request that opens a stream."""
    wanted = (
        "Upgrade: websocket",
        "Connection: Upgrade",
        "Sec-WebSocket-Version: 13",
        "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==",
    )
    return raw_http.request("GET", path, b"", *wanted, *headers)


def frame(content, first=0x82, mask=b"\0\0\0\0"):
    """Return a frame of a client."""
    size = len(content)
    if size < 126:
        head = bytes([first, 0x80 | size])
    elif size < 2**16:
        head = bytes([first, 0x80 | 126]) + size.to_bytes(2, "big")
    else:
        head = bytes([first, 0x80 | 127]) + size.to_bytes(8, "big")
    masked = bytes(byte ^ mask[i % 4] for i, byte in enumerate(content)) if any(mask) else content
    return head + mask + masked


class StreamClient:
    """Sends messages, numbered from 1."""

    def __init__(self, address, instance, *headers, **query):
        query = {"key": "k", **{name: word for name, word in query.items() if word is not None}}
        path = f"{instance}/stream/?{urllib.parse.urlencode(query)}"
        self.socket = socket.create_connection(address, timeout=30)
        self.number = 0
        self.socket.sendall(upgrade(path, *headers))
        self._data = b""
        while b"\r\n\r\n" not in self._data:
            self._more()
        head, _, self._data = self._data.partition(b"\r\n\r\n")
        self.head = head.decode()
        self.status = int(head.split()[1])
        if self.status == 101:
            opcode, text = self.receive_frame()
            assert opcode == 1
            self.layout = json.loads(text)

    def _more(self):
        data = self.socket.recv(2**16)
        if not data:
            raise ConnectionError("the stream has ended")
        self._data += data

    def _take(self, size):
        while len(self._data) < size:
            self._more()
        taken, self._data = self._data[:size], self._data[size:]
        return taken

    def receive_frame(self):
        """Return the opcode and the content of the next frame."""
        first, size = self._take(2)
        assert first & 0xF0 == 0x80
        if size > 125:
            size = int.from_bytes(self._take(2 if size == 126 else 8), "big")
        return first & 0x0F, self._take(size)

    def closing(self):
        """Return the code and the words with which the server ends the stream."""
        opcode, content = self.receive_frame()
        while opcode != 8:
            opcode, content = self.receive_frame()
        return int.from_bytes(content[:2], "big"), content[2:].decode()

    def message(self, what, form=ARRAYS, content=b"", flags=0, number=None):
        if number is None:
            self.number += 1
            number = self.number
        return REQUEST.pack(what, form, flags, number) + content

    def ask(self, what, form=ARRAYS, content=b"", flags=0, number=None):
        """Send a message; return the answer's form, status, content and JSON at the end."""
        self.socket.sendall(frame(self.message(what, form, content, flags, number)))
        return self.answer()

    def answer(self):
        opcode, content = self.receive_frame()
        assert opcode == 2, (opcode, content)
        form, status, size, self.answered = ANSWER.unpack_from(content)
        end = len(content) - size
        last = json.loads(content[end:]) if size else None
        content = content[ANSWER.size : end]
        return form, status, json.loads(content) if form == JSON_BODY else content, last

    def reset(self, **fields):
        return self.ask(RESET, JSON_BODY, json.dumps(fields).encode())

    def step(self, *actions, **how):
        """Take a step with actions of a Discrete space."""
        return self.ask(STEP, ARRAYS, struct.pack(f"<{len(actions)}i", *actions), **how)

    def arrays(self, content, what="step"):
        """Return the arrays of an answer, as lists."""
        found = {}
        for name, place in self.layout[what].items():
            code = {"F64": "d", "F32": "f", "I64": "q", "BOOL": "?", "U8": "B"}[place["dtype"]]
            begin, end = place["data_offsets"]
            found[name] = [value for (value,) in struct.iter_unpack(f"<{code}", content[begin:end])]
        return found

    def close(self):
        self.socket.close()
