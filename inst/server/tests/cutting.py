"""Connections that are cut after a number of bytes, and a client that numbers its requests.

For tests. ``python cutting.py SERVER_PORT`` runs a proxy for clients in other processes. It prints
its port and then reads commands: ``request 17`` or ``answer 170`` sets where to cut the next
request to a step, or its response; ``none`` cuts nothing. It answers each with a line: the number
of cuts, and the sizes of the last complete request and response.
"""

import json
import socket
import struct
import sys
import threading


class Cutter:
    """A proxy that forwards each byte at once, and cuts a connection on demand."""

    def __init__(self, port, pattern=b"/step"):
        self.port, self.pattern = port, pattern
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
                while self._exchange(client, server):
                    pass
            except OSError:
                pass

    def _exchange(self, client, server):
        """Forward a request and its response; return whether to keep the connection."""
        request = read_message(client)
        if request is None:
            return False
        where, after = self._cut_for(request)
        if where == "request":
            server.sendall(request[:after])
            return self._break(client, server)
        server.sendall(request)
        answer = read_message(server)
        if answer is None:
            return False
        if where == "answer":
            client.sendall(answer[:after])
            return self._break(client, server)
        if self.pattern in request.split(b"\r\n", 1)[0]:
            self.sizes = {"request": len(request), "answer": len(answer)}
        client.sendall(answer)
        return True

    def _cut_for(self, request):
        with self._lock:
            if self.where is None or self.pattern not in request.split(b"\r\n", 1)[0]:
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
    cutter = Cutter(int(sys.argv[1]))
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
