"""Clients that never read their responses: how other clients fare meanwhile.

    tools/in-env python tools/soak/unread.py [CONNECTIONS [SECONDS]]

First without the token on a server that has one, requesting the watch page's files, which need no
token; then on a server without a token, requesting large observations, from another address and
from the same. Clients that are disconnected come again.
"""

from __future__ import annotations

import contextlib
import select
import socket
import subprocess
import sys
import time
from pathlib import Path

from bystander import Bystander
from serving import Client, ServerProcess, allow_many_open_files

TOKEN = "correct-horse-battery"
HOST = "HTTP/1.1\r\nHost: 127.0.0.1\r\n"
# 11 KB each. The observations of this many sub-environments are 256 KB.
PAGE_FILE = f"GET /v1/envs/00000000/watch/watch.js {HOST}\r\n".encode() * 100
NUM_ENVS = 16384
RECEIVE_BYTES = 2048
# The limit of new connections per second.
MOST_A_SECOND = 1000


def observations(port: int) -> bytes:
    """Return requests with large responses that cost the server little."""
    created = Client(port).post("/v1/envs/", env_id="CartPole-v1", num_envs=NUM_ENVS)
    head = (
        f"POST /v1/envs/{created['instance_id']}/reset/ {HOST}Accept: application/x-safetensors\r\n"
    )
    return f"{head}Content-Length: 2\r\n\r\n{{}}".encode() * 5


def crowd(port: int, source: str, what: str, number: int, seconds: float) -> None:
    """Send requests on many connections and read nothing, for some seconds."""
    allow_many_open_files()
    request = PAGE_FILE if what == "files" else observations(port)
    poll = select.poll()
    connections: dict[int, socket.socket] = {}
    opened = 0
    began = time.monotonic()
    while time.monotonic() < began + seconds:
        for descriptor, _ in poll.poll(0):
            poll.unregister(descriptor)
            connections.pop(descriptor).close()
        while len(connections) < number and opened < MOST_A_SECOND * (time.monotonic() - began):
            one = _ask(port, source, request)
            connections[one.fileno()] = one
            poll.register(one.fileno(), select.POLLHUP | select.POLLERR)
            opened += 1
        time.sleep(0.01)
    print(f"{opened} connections made, {len(connections)} held at the end", flush=True)
    for one in connections.values():
        one.close()


def _ask(port: int, source: str, request: bytes) -> socket.socket:
    one = socket.socket()
    one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BYTES)
    one.bind((source, 0))
    one.setblocking(False)
    with contextlib.suppress(BlockingIOError):
        one.connect(("127.0.0.1", port))
    one.setblocking(True)
    one.settimeout(1.0)
    with contextlib.suppress(OSError):
        one.send(request)
    return one


def beside(what: str, source: str, token: str | None, number: int, seconds: float) -> bool:
    """Measure another client before, during and after; return whether it got its responses."""
    asked = "observations" if token is None else "files"
    server = ServerProcess(**({"GYM_SERVER_TOKEN": token} if token else {}))
    bystander = Bystander(server.port, token)
    time.sleep(5)
    said, _, _ = bystander.figures()
    print(f"{what} before: {said}; {server.usage()}, {_socket_megabytes()} MB in sockets")
    told = (server.port, source, asked, number, seconds)
    attack = subprocess.Popen([sys.executable, __file__, "crowd", *map(str, told)])
    time.sleep(seconds - 2)
    usage, in_sockets = server.usage(), _socket_megabytes()
    said, slowest, failed = bystander.figures()
    print(f"{what} during: {said}; {usage}, {in_sockets} MB in sockets", flush=True)
    attack.wait()
    time.sleep(5)
    bystander.figures()
    time.sleep(5)
    after, _, _ = bystander.figures()
    print(f"{what} after: {after}; {server.usage()}, {_socket_megabytes()} MB in sockets")
    bystander.stop()
    server.stop()
    print(f"unread: {what}: {said}, {usage['MB']} MB, {usage['threads']} threads")
    return failed == 0 and slowest < 5


def _socket_megabytes() -> int:
    words = Path("/proc/net/sockstat").read_text().split()
    return int(words[words.index("mem") + 1]) * 4096 // 2**20


def main(number: int, seconds: float) -> int:
    """Run all parts; return the exit status."""
    held = [
        beside("no token", "127.0.0.1", TOKEN, number, seconds),
        beside("other address", "127.0.0.2", None, number, seconds),
        beside("same address", "127.0.0.1", None, number, seconds),
    ]
    return int(not all(held))


if __name__ == "__main__":
    if sys.argv[1:2] == ["crowd"]:
        crowd(int(sys.argv[2]), *sys.argv[3:5], int(sys.argv[5]), float(sys.argv[6]))
    else:
        arguments = sys.argv[1:] or ["4050", "60"]
        sys.exit(main(int(arguments[0]), float(arguments[1])))
