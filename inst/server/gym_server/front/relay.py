"""One connection that is passed on: bytes between a client and the user's server."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable
from functools import partial
from selectors import EVENT_READ, EVENT_WRITE, BaseSelector

# What is read at a time, and with that the most that is kept of each direction.
_PIECE_BYTES = 2**16


class _End:
    """One of the two sockets.

    Attributes:
        other: the other end.
        unsent: what this end's peer has not taken yet.
        has_ended: whether the peer sends no more.
        events: what the loop watches for.
    """

    other: _End

    def __init__(self, sock: socket.socket, unsent: bytes = b"") -> None:
        self.socket = sock
        self.unsent = unsent
        self.has_ended = False
        self.events = 0


class Relay:
    """Passes bytes both ways until one end closes.

    A reader that is slow stops only its own connection: nothing is read for it until it has taken
    what there is.

    Attributes:
        is_busy: whether the client waits for an answer.
        moved_at: when bytes passed last, in the clock's seconds.
    """

    def __init__(
        self,
        selector: BaseSelector,
        client: socket.socket,
        server: socket.socket,
        request: bytes,
        ended: Callable[[], None],
        refused: Callable[[], None],
    ) -> None:
        """Begin to pass bytes.

        Args:
            selector: calls ``ready()`` of the data that it has for a socket.
            client: the client's socket; like the server's, it does not block.
            server: a socket that is connected or connecting.
            request: what the client has sent.
            ended: is called at the end.
            refused: is called instead if the server accepts no connection; the client is left open.
        """
        self._selector = selector
        self._ended = ended
        self._refused = refused
        self._client, self._server = _End(client), _End(server, request)
        self._client.other, self._server.other = self._server, self._client
        self.is_busy = True
        self.moved_at = time.monotonic()
        for end in (self._client, self._server):
            self._watch(end)

    def _watch(self, end: _End) -> None:
        """Watch a socket for what can be done with it."""
        if end.socket.fileno() < 0:
            return
        reads = not end.has_ended and not end.other.unsent
        events = (EVENT_READ if reads else 0) | (EVENT_WRITE if end.unsent else 0)
        if events == end.events:
            return
        if not events:
            self._selector.unregister(end.socket)
        elif not end.events:
            self._selector.register(end.socket, events, partial(self._ready, end))
        else:
            key = self._selector.get_key(end.socket)
            self._selector.modify(end.socket, events, key.data)
        end.events = events

    def _ready(self, end: _End, events: int) -> None:
        # Another socket's event may just have closed this one.
        if end.socket.fileno() < 0:
            return
        try:
            if events & EVENT_WRITE:
                self._send(end, end.unsent)
            if events & EVENT_READ and self._receive(end):
                return
        except BlockingIOError:
            return
        except ConnectionRefusedError:
            self._give_back()
            return
        except OSError:
            self.close()
        for one in (end, end.other):
            self._watch(one)

    def _receive(self, end: _End) -> bool:
        """Pass on what has arrived; return whether the sockets can be watched as before."""
        data = end.socket.recv(_PIECE_BYTES)
        if data:
            self.is_busy = end is self._client
            self.moved_at = time.monotonic()
            self._send(end.other, data)
            return not end.other.unsent and not end.unsent
        end.has_ended = True
        if not end.other.unsent:
            self._end_writing(end.other)
        return False

    def _send(self, end: _End, data: bytes) -> None:
        try:
            sent = end.socket.send(data)
        except BlockingIOError:
            sent = 0
        end.unsent = data[sent:]
        if not end.unsent and end.other.has_ended:
            self._end_writing(end)

    def _end_writing(self, end: _End) -> None:
        if end is self._client or end.has_ended:
            self.close()
        else:
            # The server still answers what it has received.
            end.socket.shutdown(socket.SHUT_WR)

    def _give_back(self) -> None:
        """Leave the client as it was: nothing has been read from it."""
        self._close(self._server)
        self._refused()

    def close(self) -> None:
        """Close both sockets, once."""
        if self._server.socket.fileno() >= 0:
            self._close(self._server)
            self._close(self._client)
            self._ended()

    def _close(self, end: _End) -> None:
        if end.events:
            self._selector.unregister(end.socket)
            end.events = 0
        end.socket.close()
