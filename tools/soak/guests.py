"""A client that creates the most expensive things allowed, while another one plays.

    tools/in-env python tools/soak/guests.py PART [ROUNDS]

PART is "memory" (nested wrappers, a map with a million fields) or "processes" (creations of 64
processes each). Another client plays before, meanwhile and afterwards, and the server's usage is
printed each time. Each load ends after its rounds, or after a minute.
"""

from __future__ import annotations

import statistics
import sys
import threading
import time

from serving import Client, RefusedError, ServerProcess

MOST_SECONDS = 60
GUESTS = 4

# The server's default limit for environments.
MOST_PROCESSES = 128
MOST_MB = 4096

STACKS = [
    {"name": "FrameStackObservation", "kwargs": {"stack_size": size}} for size in (1000, 1000, 40)
]


class Player:
    """Another client, and how long its responses take."""

    def __init__(self, port: int) -> None:
        self._client = Client(port)
        created = self._client.post("/v1/envs/", env_id="CartPole-v1")
        self._url = f"/v1/envs/{created['instance_id']}"
        self._client.post(f"{self._url}/reset/", seed=1)

    def play(self, seconds: float, until=lambda: False) -> list[float]:
        """Play for some seconds; return the duration of each response."""
        took: list[float] = []
        end = time.monotonic() + seconds
        while time.monotonic() < end and not until():
            began = time.monotonic()
            done = self._client.post(f"{self._url}/step/", action=1)["done"]
            took.append(time.monotonic() - began)
            if done:
                self._client.post(f"{self._url}/reset/")
            time.sleep(0.005)
        return took


def ask(client: Client, granted: list[str], path: str, **fields: object) -> dict | None:
    """Send a request; return the response, or None if it was refused."""
    try:
        answer = client.post(path, **fields)
    except RefusedError as refusal:
        if refusal.status not in (400, 429, 504):
            raise
        return None
    granted.append(path)
    return answer


def memory(port: int, granted: list[str]) -> None:
    """Request gigabytes."""
    client = Client(port)
    ask(client, granted, "/v1/envs/", env_id="CartPole-v1", wrappers=STACKS)
    fields = {"desc": ["S" * 1000] * 1000}
    ask(client, granted, "/v1/envs/", env_id="FrozenLake-v1", kwargs=fields)
    ask(client, granted, "/v1/envs/", env_id="Taxi-v4", num_envs=16_384)
    client.close()


def processes(port: int, granted: list[str]) -> None:
    """Request many processes, and keep them."""
    client = Client(port)
    fields = {"num_envs": 64, "num_workers": 64}
    ask(client, granted, "/v1/envs/", env_id="CartPole-v1", **fields)
    client.close()


PARTS = {"memory": memory, "processes": processes}


def main(name: str, rounds: int) -> int:
    """Run a part; return the exit status."""
    server = ServerProcess("--log-level", "error")
    player = Player(server.port)
    player.play(1)
    held, took = {}, {}
    held["before"], took["before"] = server.usage(), player.play(5)
    granted: list[str] = []
    most: dict[str, int] = {}
    end = time.monotonic() + MOST_SECONDS

    def be_guest() -> None:
        for _ in range(rounds):
            if time.monotonic() > end:
                return
            PARTS[name](server.port, granted)

    guests = [threading.Thread(target=be_guest, daemon=True) for _ in range(GUESTS)]

    def gone() -> bool:
        now = server.usage()
        most.update({what: max(number, most.get(what, 0)) for what, number in now.items()})
        return not any(guest.is_alive() for guest in guests)

    for guest in guests:
        guest.start()
    took["during"] = player.play(2 * MOST_SECONDS, gone)
    held["most during"] = most
    close_all(server.port)
    player = Player(server.port)
    # Closed processes end a moment later.
    time.sleep(5)
    held["after"], took["after"] = server.usage(), player.play(5)
    status = server.stop()
    for when, usage in held.items():
        print(f"{when}: {usage}")
    words = "; ".join(f"{when} {told(seconds)}" for when, seconds in took.items())
    print(
        f"{name}: answers of another {words}; from {held['before']} to {held['after']}, "
        f"at most {most}; {len(granted)} of {GUESTS * rounds} rounds' requests granted"
    )
    return int(status != 0 or any(problems(held)))


def close_all(port: int) -> None:
    """Close every environment."""
    client = Client(port)
    for instance_id in client.get("/v1/envs/")["all_envs"]:
        client.post(f"/v1/envs/{instance_id}/close/")
    client.close()


def told(seconds: list[float]) -> str:
    """Return the median and the worst of some durations in words."""
    if not seconds:
        return "none"
    return f"{1000 * statistics.median(seconds):.1f} (worst {1000 * max(seconds):.0f}) ms"


def problems(held: dict[str, dict[str, int]]) -> list[bool]:
    """Return whether each limit was broken."""
    before, most, after = (held[when] for when in ("before", "most during", "after"))
    return [
        # The server, its helpers, and the granted processes, which have memory of their own.
        most["processes"] > before["processes"] + MOST_PROCESSES + 4,
        most["MB"] > before["MB"] + MOST_MB + 40 * (most["processes"] - before["processes"]),
        after["processes"] > before["processes"] + 2,
        after["threads"] > before["threads"] + 8,
        after["files"] > before["files"] + 32,
    ]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 10))
