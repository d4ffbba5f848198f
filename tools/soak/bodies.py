"""Incomplete bodies, and bodies in tiny pieces: how other clients fare meanwhile.

    tools/in-env python tools/soak/bodies.py [TIMES]

First one after another, in chunks of two bytes; then many at once without their last byte.
"""

from __future__ import annotations

import contextlib
import socket
import subprocess
import sys
import time

from bystander import Bystander
from serving import ServerProcess

HEAD = b"POST /v1/envs/ HTTP/1.1\r\nHost: 127.0.0.1\r\n"
MEGABYTE = 2**20
BODY = 16 * MEGABYTE
CHUNKS = b"2\r\nab\r\n" * 2**14
HELD_SECONDS = 10
# Longer than the server waits before it returns free memory.
AFTER_SECONDS = 45


def tiny_chunks(port: int, times: int) -> None:
    """Send nearly the allowed size, two bytes at a time, and disconnect; several times."""
    for _ in range(times):
        with _connect(port) as one, contextlib.suppress(ConnectionError):
            one.sendall(HEAD + b"Transfer-Encoding: chunked\r\n\r\n")
            for _ in range(BODY // 2**15 - 1):
                one.sendall(CHUNKS)


def half_sent(port: int, times: int) -> None:
    """Send all but the last byte of many bodies, wait, and disconnect."""
    crowd = [_connect(port) for _ in range(6 * times)]
    for one in crowd:
        one.sendall(HEAD + b"Content-Length: %d\r\n\r\n" % BODY)
    for _ in range(BODY // MEGABYTE - 1):
        for one in crowd:
            one.sendall(bytes(MEGABYTE))
    for one in crowd:
        one.sendall(bytes(MEGABYTE - 1))
    time.sleep(HELD_SECONDS)
    for one in crowd:
        one.close()


def _connect(port: int) -> socket.socket:
    return socket.create_connection(("127.0.0.1", port), timeout=30)


KINDS = {"tiny chunks": tiny_chunks, "half-sent": half_sent}


def beside(what: str, times: int) -> bool:
    """Measure another client before, during and after; return whether all was well."""
    server = ServerProcess()
    bystander = Bystander(server.port)
    time.sleep(5)
    before = server.usage()
    print(f"{what} before: {bystander.figures()[0]}; {before}", flush=True)
    attack = subprocess.Popen([sys.executable, __file__, what, str(server.port), str(times)])
    most = before
    while attack.poll() is None:
        most = max(most, server.usage(), key=lambda usage: usage["MB"])
        time.sleep(0.1)
    said, slowest, failed = bystander.figures()
    print(f"{what} during: {said}; at most {most}", flush=True)
    time.sleep(AFTER_SECONDS)
    after = server.usage()
    print(f"{what} after: {bystander.figures()[0]}; {after}", flush=True)
    bystander.stop()
    server.stop()
    print(f"bodies: {what}: {said}, {before['MB']} MB, {most['MB']} MB, {after['MB']} MB")
    return failed == 0 and slowest < 5 and after["MB"] < before["MB"] + 50


def main(times: int) -> int:
    """Run both; return the exit status."""
    held = [beside(what, times) for what in KINDS]
    return int(not all(held))


if __name__ == "__main__":
    if sys.argv[1:2] and sys.argv[1] in KINDS:
        KINDS[sys.argv[1]](*map(int, sys.argv[2:]))
    else:
        sys.exit(main(*map(int, sys.argv[1:] or ["10"])))
