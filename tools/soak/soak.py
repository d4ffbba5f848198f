"""Days of use in half an hour: clients that connect, play, look, leave, or are killed.

    tools/in-env python tools/soak/soak.py [SECONDS]

Eight at a time, two of them R; one in ten is killed at a random moment. The server's usage is
printed at the start, six times during the test, and at the end, after it has had the time to close
unused instances (--idle-minutes).
"""

from __future__ import annotations

import random
import subprocess
import sys
import time
from pathlib import Path

from serving import SERVER, Client, RefusedError, ServerProcess

HERE = Path(__file__).parent
AT_ONCE = 8
IDLE_MINUTES = 1

KINDS = [
    {"env_id": "CartPole-v1"},
    {"env_id": "CartPole-v1", "num_envs": 64},
    {"env_id": "Pendulum-v1", "num_envs": 8},
    {"env_id": "Acrobot-v1", "render_mode": "human"},
    {"env_id": "faulty_envs:Counting-v0", "kwargs": {"length": 100}},
    {"env_id": "faulty_envs:Drawing-v0"},
    {"env_id": "faulty_envs:RaisesInStep-v0"},
    {"env_id": "CartPole-v1", "num_envs": 2, "vectorization_mode": "async"},
]


def live(port: int, seed: int, seconds: float) -> None:
    """Be a client for some seconds."""
    rng = random.Random(seed)
    client = Client(port)
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        kind = rng.choice(KINDS)
        url = f"/v1/envs/{client.post('/v1/envs/', **kind)['instance_id']}"
        client.post(f"{url}/reset/", seed=rng.randrange(1000))
        for _ in range(rng.randrange(10, 200)):
            if time.monotonic() > end:
                break
            step(client, url, kind, rng)
        look(client, url, rng)
        client.post(f"{url}/close/")
        refused(client, 400, f"{url}/step/", action=0)
    client.close()


def step(client: Client, url: str, kind: dict, rng: random.Random) -> None:
    """Step once, and sometimes reset ended sub-environments."""
    num_envs = kind.get("num_envs")
    if "Pendulum" in kind["env_id"]:
        action: object = [[rng.uniform(-2, 2)] for _ in range(num_envs)]
    else:
        action = [rng.randrange(2) for _ in range(num_envs)] if num_envs else rng.randrange(2)
    if "Raises" in kind["env_id"] and action == 1:
        refused(client, 500, f"{url}/step/", action=1)
    elif client.post(f"{url}/step/", action=action)["done"] is True:
        client.post(f"{url}/reset/")


def look(client: Client, url: str, rng: random.Random) -> None:
    """Do what people do besides playing."""
    assert client.get(f"{url}/")["instance_id"] in url
    assert client.get("/v1/health/")["status"] == "ok"
    assert url.split("/")[3] in client.get("/v1/envs/")["all_envs"]
    if rng.random() < 0.5:
        seen = client.get(f"{url}/watch/state/")
        client.get(f"{url}/watch/presence/")
        assert client.get(f"{url}/watch/")[:15].lower() == b"<!doctype html>"
        if seen["frame"] is not None:
            assert client.get(f"{url}/render/")[:4] == b"\x89PNG"


def refused(client: Client, status: int, path: str, **fields: object) -> None:
    """Make a call that must be refused."""
    try:
        client.post(path, **fields)
    except RefusedError as refusal:
        if refusal.status == status:
            return
        raise
    raise AssertionError("it was not refused")


class Slot:
    """A place for one client after another."""

    def __init__(self, port: int, in_r: bool, rng: random.Random) -> None:
        self.port, self.in_r, self.rng = port, in_r, rng
        self.lives = self.killed = self.failed = 0
        self.process: subprocess.Popen | None = None

    def turn(self) -> None:
        """Check the current client, and start the next one."""
        if self.process is None:
            self._begin()
        elif self.process.poll() is not None:
            # Killed clients have a negative status.
            if self.process.returncode != 0 and not self.is_to_be_killed:
                self.failed += 1
            self._begin()
        elif self.is_to_be_killed and time.monotonic() > self.dies:
            self.process.kill()
            self.process.wait()
            self.killed += 1
            self._begin()

    def _begin(self) -> None:
        seconds = self.rng.uniform(3, 15)
        script = ["Rscript", "--no-init-file", str(HERE / "soak.R")]
        if not self.in_r:
            script = [sys.executable, __file__, "live"]
        told = (self.port, self.rng.randrange(10**6), seconds)
        self.process = subprocess.Popen([*script, *map(str, told)])
        self.is_to_be_killed = self.rng.random() < 0.1
        self.dies = time.monotonic() + self.rng.uniform(1, seconds)
        self.lives += 1

    def end(self) -> None:
        """Wait for the last client."""
        if self.process is not None and self.process.wait() != 0 and not self.is_to_be_killed:
            self.failed += 1


def main(seconds: float) -> int:
    """Run the test on a server; return the exit status."""
    reaps = "--idle-minutes" in _help()
    options = ("--idle-minutes", str(IDLE_MINUTES)) if reaps else ()
    server = ServerProcess(*options)
    watcher = Client(server.port)
    slots = [Slot(server.port, number < 2, random.Random(number)) for number in range(AT_ONCE)]
    held = {}

    def note(when: str) -> None:
        held[when] = {**server.usage(), "environments": watcher.get("/v1/health/")["instances"]}
        words = ", ".join(f"{what} {number}" for what, number in held[when].items())
        print(f"{when:>8}: {words}", flush=True)

    _warm_up(watcher)
    note("start")
    began = time.monotonic()
    for part in range(6):
        while time.monotonic() < began + seconds * (part + 1) / 6:
            for slot in slots:
                slot.turn()
            time.sleep(0.05)
        note(f"{(part + 1) * seconds / 360:.1f} min")
    for slot in slots:
        slot.end()
    if reaps:
        time.sleep(IDLE_MINUTES * 60 + 30)
    else:
        note("unreaped")
        for instance_id in watcher.get("/v1/envs/")["all_envs"]:
            watcher.post(f"/v1/envs/{instance_id}/close/")
        time.sleep(2)
    note("end")
    status = server.stop()
    lives, killed, failed = (
        sum(getattr(slot, what) for slot in slots) for what in ("lives", "killed", "failed")
    )
    start, end = held["start"], held["end"]
    warm = held[f"{seconds / 360:.1f} min"]
    grown = {what: end[what] - start[what] for what in end}
    print(
        f"soak: {seconds / 60:.0f} min, {lives} clients, {killed} killed, "
        f"unexpected errors {failed}, grown by {grown} "
        f"(memory {end['MB'] - warm['MB']} MB since the first sixth), "
        f"exit status {status}"
    )
    problems = [
        failed > 0,
        status != 0,
        reaps and grown["environments"] > 0,
        grown["threads"] > 8,
        # The queues of sub-environments in processes are freed when Python collects garbage.
        grown["files"] > 32,
        grown["processes"] > 2,
        end["MB"] > 1.25 * warm["MB"] + 20,
    ]
    return int(any(problems))


def _warm_up(client: Client) -> None:
    """Load everything that the first of each kind loads."""
    for kind in KINDS:
        url = f"/v1/envs/{client.post('/v1/envs/', **kind)['instance_id']}"
        client.post(f"{url}/reset/", seed=1)
        client.get(f"{url}/watch/state/")
        client.post(f"{url}/close/")


def _help() -> str:
    command = [sys.executable, "-m", "gym_server", "--help"]
    return subprocess.run(command, cwd=SERVER, stdout=subprocess.PIPE, text=True).stdout


if __name__ == "__main__":
    if sys.argv[1:2] == ["live"]:
        live(int(sys.argv[2]), int(sys.argv[3]), float(sys.argv[4]))
    else:
        sys.exit(main(float(sys.argv[1]) if len(sys.argv) > 1 else 1800.0))
