"""Endless fresh idempotency keys must not make another client's step be taken twice.

    tools/in-env python tools/soak/keys.py [KEYS]

Four processes send the keys, a quarter each: to an unknown instance, in steps that are refused, in
creations that are closed again, and in the victim's own guessed key with a huge number. Then the
victim repeats its last creation and its last step, whose responses it never got.
"""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
import time

from serving import Client, RefusedError, ServerProcess

HUGE = 2**62
GUESSED = "guessed"


class Caller(Client):
    """A client that sets its own idempotency keys."""

    def call(self, path: str, key: str, number: int, **fields: object) -> dict | bytes | None:
        """Make a call with an idempotency key; return None if it is refused."""
        self._key, self._number = key, number
        fields["request"] = {"key": key, "number": number}
        try:
            return self._call("POST", path, json.dumps(fields), {})
        except RefusedError:
            return None


def attack(port: int, how: str, keys: int) -> None:
    """Send fresh keys."""
    caller = Caller(port)
    created = caller.call("/v1/envs/", f"{how}-make", 1, env_id="CartPole-v1")
    own = f"/v1/envs/{created['instance_id']}"
    caller.call(f"{own}/reset/", f"{how}-make", 2)
    for number in range(keys):
        key = f"{how}-{number}"
        if how == "unknown":
            caller.call("/v1/envs/00000000/step/", key, 1, action=0)
        elif how == "refused":
            caller.call(f"{own}/step/", key, 1, action=9)
        elif how == "closed":
            created = caller.call("/v1/envs/", key, 1, env_id="CartPole-v1")
            caller.call(f"/v1/envs/{created['instance_id']}/close/", key, 2)
        else:
            caller.call(f"{own}/reset/", GUESSED, HUGE + number)
            caller.call(f"{own}/reset/", key, 1)
    caller.call(f"{own}/close/", f"{how}-make", 3)


def answers(client: Client, url: str, until: subprocess.Popen | float) -> str:
    """Return how long a client's steps take, for some seconds or while a process runs."""
    seconds = []
    end = time.monotonic() + until if isinstance(until, float) else float("inf")
    while time.monotonic() < end and (isinstance(until, float) or until.poll() is None):
        began = time.monotonic()
        done = client.post(f"{url}/step/", action=1)["done"]
        seconds.append(time.monotonic() - began)
        if done:
            client.post(f"{url}/reset/")
        time.sleep(0.005)
    return f"{statistics.median(seconds) * 1000:.1f} (worst {max(seconds) * 1000:.0f}) ms"


def main(keys: int) -> int:
    """Attack a server; return the exit status."""
    server = ServerProcess("--log-level", "error")
    victim, other = Caller(server.port), Client(server.port)
    making = {"env_id": "faulty_envs:Counting-v0", "kwargs": {"length": 10**9}}
    created = victim.call("/v1/envs/", GUESSED, 1, **making)
    url = f"/v1/envs/{created['instance_id']}"
    victim.call(f"{url}/reset/", GUESSED, 2)
    first = victim.call(f"{url}/step/", GUESSED, 3, action=0)
    play = f"/v1/envs/{other.post('/v1/envs/', env_id='CartPole-v1')['instance_id']}"
    other.post(f"{play}/reset/")
    before, answered = server.usage(), {"before": answers(other, play, 3.0)}
    command = [sys.executable, __file__, "attack", str(server.port)]
    began = time.monotonic()
    attackers = [
        subprocess.Popen([*command, how, str(keys // 4)])
        for how in ("unknown", "refused", "closed", "guessed")
    ]
    answered["during"] = answers(other, play, attackers[0])
    came_through = [one.wait() == 0 for one in attackers]
    took = time.monotonic() - began
    answered["after"] = answers(other, play, 3.0)
    after = server.usage()
    repeated = {
        "creation": victim.call("/v1/envs/", GUESSED, 1, **making) == created,
        "step": victim.call(f"{url}/step/", GUESSED, 3, action=0) == first,
        "once": victim.get(f"{url}/")["steps"] == 1,
        "next": (victim.call(f"{url}/step/", GUESSED, 4, action=0) or {}).get("observation") == [2],
    }
    server.stop()
    times = ", ".join(f"{when} {figures}" for when, figures in answered.items())
    print(
        f"keys: {keys} keys in {took:.0f} s, the victim's step "
        f"{'was done once' if all(repeated.values()) else f'FAILED: {repeated}'}; "
        f"another's steps {times}; held before {before}, after {after}"
    )
    grown = after["MB"] > before["MB"] + 100 or after["threads"] > before["threads"] + 3
    return int(grown or not all(repeated.values()) or not all(came_through))


if __name__ == "__main__":
    if sys.argv[1:2] == ["attack"]:
        attack(int(sys.argv[2]), sys.argv[3], int(sys.argv[4]))
    else:
        sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 40_000))
