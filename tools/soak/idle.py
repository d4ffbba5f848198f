"""A thousand idle connections, and a thousand with half a request.

    tools/in-env python tools/soak/idle.py [CONNECTIONS]

Meanwhile health must answer within a second, and another client must be able to play.
"""

from __future__ import annotations

import socket
import sys
import time

from serving import Client, ServerProcess, allow_many_open_files

HALF = b"POST /v1/envs/ HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 100\r\n\r\n{"


def main(number: int) -> int:
    """Run both; return the exit status."""
    server = ServerProcess()
    allow_many_open_files()
    player = Client(server.port)
    url = f"/v1/envs/{player.post('/v1/envs/', env_id='CartPole-v1')['instance_id']}"
    player.post(f"{url}/reset/", seed=1)
    slowest = {}
    for what, said in (("idle", b""), ("half-sent", HALF)):
        before = server.usage()
        crowd = []
        for _ in range(number):
            one = socket.create_connection(("127.0.0.1", server.port), timeout=30)
            one.sendall(said)
            crowd.append(one)
        slowest[what] = max(_health_seconds(server.port) for _ in range(10))
        player.post(f"{url}/step/", action=1)
        during = server.usage()
        for one in crowd:
            one.close()
        _wait_until(lambda was=before["threads"]: server.usage()["threads"] <= was + 3)
        after = server.usage()
        print(f"{what} connections: before {before}, during {during}, after {after}", flush=True)
        if after["threads"] > before["threads"] + 3 or after["files"] > before["files"] + 3:
            slowest[what] = float("inf")
    server.stop()
    figures = ", ".join(
        f"beside {number} {what} ones health within {seconds * 1000:.0f} ms"
        for what, seconds in slowest.items()
    )
    print(f"idle: {figures}")
    return int(max(slowest.values()) > 1)


def _health_seconds(port: int) -> float:
    began = time.monotonic()
    client = Client(port)
    assert client.get("/v1/health/")["status"] == "ok"
    client.close()
    return time.monotonic() - began


def _wait_until(holds, seconds: float = 20) -> None:
    end = time.monotonic() + seconds
    while not holds() and time.monotonic() < end:
        time.sleep(0.1)


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 1000))
