"""Connections that are cut after a number of bytes, and a client that numbers its requests.

For tests. ``python cutting.py SERVER_PORT [stream]`` runs a proxy for clients in other processes.
It prints its port and then reads commands: ``request 17`` or ``answer 170`` sets where to cut the
next message by HTTP, or its response; ``none`` cuts nothing. It answers each with a line: the
number of cuts, and the sizes of the last complete request and response. With ``stream`` these are
the messages of streams; without it no stream can be opened.
"""

import json
import socket
import struct
import sys
import threading


class Cutter:
    """A proxy that forwards each byte at once, and cuts a connection on demand."""

    def __init__(self, port, pattern=b"/step", streams=False):
        self.port, self.pattern, self.streams = port, pattern, streams
        self.where, self.after = None, 0
        self.cuts = 0
        # The sizes of the last complete ones.
        self.sizes = {"request": 0, "answer": 0}
        self._lock = threading.Lock()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.address = self._listener.getsockname()
        threading.Thread(target=self._accept, daemon=True).start()

    def cut(self, where, after):
        """Cut the next "request" or "answer" after this many bytes."""
        with self._lock:
            self.where, self.after = where, after

    def close(self):
        self._listener.close()

    def _accept(self):
        while True:
            try:
                client, _ = self._listener.accept()
            except OSError:
                return
            threading.Thread(target=self._serve, args=(client,), daemon=True).start()

    def _serve(self, client):
        server = socket.create_connection(("127.0.0.1", self.port))
        with client, server:
            try:
                while self._exchange(client, server, read_message, read_message):
                    pass
            except OSError:
                pass

    def _exchange(self, client, server, read_request, read_answer):
        """Forward a request and its response; return whether to keep the connection."""
        request = read_request(client)
        if request is None:
            return False
        if not self.streams:
            request = request.replace(b"Upgrade: websocket\r\n", b"")
        where, after = self._cut_for(request)
        if where == "request":
            server.sendall(request[:after])
            return self._break(client, server)
        server.sendall(request)
        answer = read_answer(server)
        if answer is None:
            return False
        if answer.startswith(b"HTTP/1.1 101 "):
            head, _, begun = answer.partition(b"\r\n\r\n")
            client.sendall(head + b"\r\n\r\n" + read_frame(server, begun))
            while self._exchange(client, server, read_frame, read_frame):
                pass
            return False
        if where == "answer":
            client.sendall(answer[:after])
            return self._break(client, server)
        if self._is_meant(request):
            self.sizes = {"request": len(request), "answer": len(answer)}
        client.sendall(answer)
        return True

    def _is_meant(self, request):
        if self.streams:
            return request[0] == BINARY
        return self.pattern in request.split(b"\r\n", 1)[0]

    def _cut_for(self, request):
        with self._lock:
            if self.where is None or not self._is_meant(request):
                return None, 0
            cut = self.where, self.after
            self.where = None
            self.cuts += 1
            return cut

    def _break(self, client, server):
        # In turn like a process that ended, and like a machine that failed.
        for one in (client, server):
            if self.cuts % 2:
                one.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            else:
                one.shutdown(socket.SHUT_WR)
        return False


def read_message(connection):
    """Return one HTTP message, or None at the end."""
    data = b""
    while b"\r\n\r\n" not in data:
        chunk = connection.recv(65536)
        if not chunk:
            return None
        data += chunk
    head, _, body = data.partition(b"\r\n\r\n")
    length = 0
    for line in head.split(b"\r\n")[1:]:
        name, _, value = line.partition(b":")
        if name.lower() == b"content-length":
            length = int(value)
    while len(body) < length:
        chunk = connection.recv(65536)
        if not chunk:
            return None
        body += chunk
    return head + b"\r\n\r\n" + body


BINARY = 0x82


def read_frame(connection, frame=b""):
    """Return one frame of a WebSocket, of which some bytes were read; None at the end."""

    def fill(size):
        nonlocal frame
        while len(frame) < size and (chunk := connection.recv(size - len(frame))):
            frame += chunk
        return len(frame) >= size

    if not fill(2):
        return None
    size, masked = frame[1] & 0x7F, frame[1] >> 7
    at = {126: 4, 127: 10}.get(size, 2)
    if at > 2 and fill(at):
        size = int.from_bytes(frame[2:at], "big")
    return frame if fill(at + 4 * masked + size) else None


class NumberedClient:
    """Numbers its requests, and repeats those whose connection broke."""

    def __init__(self, address, key):
        self.address, self.key, self.number = address, key, 0
        self.repeats = 0
        self._socket = None

    def request(self, path, **fields):
        """Return the bytes of the next request."""
        self.number += 1
        fields["request"] = {"key": self.key, "number": self.number}
        body = json.dumps(fields).encode()
        head = f"POST {path} HTTP/1.1\r\nHost: {self.address[0]}:{self.address[1]}\r\n"
        return f"{head}Content-Length: {len(body)}\r\n\r\n".encode() + body

    def send(self, request):
        """Send a request until there is a response; return its JSON."""
        while True:
            if self._socket is None:
                self._socket = socket.create_connection(self.address, timeout=30)
            try:
                self._socket.sendall(request)
                answer = read_message(self._socket)
            except ConnectionError:
                answer = None
            if answer is not None:
                return json.loads(answer.partition(b"\r\n\r\n")[2] or b"null")
            self.repeats += 1
            self.close()

    def post(self, path, **fields):
        return self.send(self.request(path, **fields))

    def close(self):
        if self._socket is not None:
            self._socket.close()
            self._socket = None


def main():
    cutter = Cutter(int(sys.argv[1]), b"/stream/", streams=sys.argv[2:] == ["stream"])
    print(cutter.address[1], flush=True)
    for line in sys.stdin:
        where, _, after = line.strip().partition(" ")
        if where == "none":
            cutter.cut(None, 0)
        else:
            cutter.cut(where, int(after))
        print(cutter.cuts, *cutter.sizes.values(), flush=True)


if __name__ == "__main__":
    main()
