"""A proxy between a client and a server that keeps the client's last request.

    recorder.py PORT    the port of the server on this machine

Reads a line per question and answers with one:

    port    the port that it listens on
    last    the last request: its head as text, its body in base64
"""

import base64
import json
import socket
import sys
import threading

server_port = int(sys.argv[1])
listener = socket.create_server(("127.0.0.1", 0))
last: dict[str, bytes] = {}


def listen() -> None:
    """Serve each connection in its own threads."""
    while True:
        client, _ = listener.accept()
        server = socket.create_connection(("127.0.0.1", server_port))
        threading.Thread(target=forward_requests, args=(client, server), daemon=True).start()
        threading.Thread(target=forward_answers, args=(server, client), daemon=True).start()


def forward_requests(client: socket.socket, server: socket.socket) -> None:
    """Forward requests, each as a whole."""
    with client.makefile("rb") as lines:
        while head := read_head(lines):
            body = lines.read(length_of(head))
            last.update(head=head, body=body)
            server.sendall(head + body)
    server.close()


def forward_answers(server: socket.socket, client: socket.socket) -> None:
    """Forward bytes as they come."""
    while data := server.recv(2**16):
        client.sendall(data)


def read_head(lines) -> bytes:
    """Read up to the empty line."""
    head = b""
    while line := lines.readline():
        head += line
        if line == b"\r\n":
            break
    return head


def length_of(head: bytes) -> int:
    """Return the length of the body that follows a head."""
    fields = dict(line.lower().split(b":", 1) for line in head.split(b"\r\n")[1:] if line)
    return int(fields.get(b"content-length", 0))


def last_request() -> dict:
    """Return the last request as JSON values."""
    return {
        "head": last["head"].decode("latin-1"),
        "body": base64.b64encode(last["body"]).decode(),
    }


threading.Thread(target=listen, daemon=True).start()
for line in sys.stdin:
    answer = {"port": lambda: listener.getsockname()[1], "last": last_request}[line.strip()]()
    print(json.dumps(answer), flush=True)
