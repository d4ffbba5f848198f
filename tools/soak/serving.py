"""A server to test, a client for it, and its use of resources."""

from __future__ import annotations

import contextlib
import http.client
import json
import os
import shlex
import struct
import subprocess
import sys
import uuid
from pathlib import Path

SERVER = Path(__file__).resolve().parents[2] / "inst" / "server"


class ServerProcess:
    """A server that ends with this process, however that ends."""

    def __init__(self, *arguments: str, **variables: str) -> None:
        """Start it, with additional environment variables, and wait until it listens."""
        self.process = subprocess.Popen(
            [
                *(sys.executable, "-m", "gym_server", "--port", "0", "--stop-on-stdin-eof"),
                *("--allow-module", "faulty_envs", *arguments),
                # For another kind of soak test: GYM_SOAK_SERVER="--max-processes 4".
                *shlex.split(os.environ.get("GYM_SOAK_SERVER", "")),
            ],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={
                **os.environ,
                **variables,
                "PYTHONPATH": os.pathsep.join([str(SERVER), str(SERVER / "tests")]),
                "PYTHONDONTWRITEBYTECODE": "1",
            },
            text=True,
        )
        self.port = int(self.process.stdout.readline().rsplit(":", 1)[1])
        self.pid = self.process.pid

    def stop(self) -> int:
        """Stop it by closing its standard input; return its exit status."""
        self.process.stdin.close()
        try:
            return self.process.wait(30)
        except subprocess.TimeoutExpired:
            self.process.kill()
            return -9

    def usage(self) -> dict[str, int]:
        """Return memory in MB, threads and open files, including its worker processes."""
        pids = [self.pid, *_descendants(self.pid)]
        return {
            "MB": sum(map(_kilobytes, pids)) // 1024,
            "threads": sum(_count(pid, "task") for pid in pids),
            "files": sum(_count(pid, "fd") for pid in pids),
            "processes": len(pids),
        }


def allow_many_open_files(most: int = 16384) -> None:
    """Let this process open many connections; call it after starting a server."""
    try:
        import resource
    except ImportError:
        return
    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(most, hard), hard))


def _descendants(pid: int) -> list[int]:
    found: list[int] = []
    for path in Path(f"/proc/{pid}/task").glob("*/children"):
        # The thread may have ended.
        with contextlib.suppress(OSError):
            found += map(int, path.read_text().split())
    return found + [one for child in found for one in _descendants(child)]


def _kilobytes(pid: int) -> int:
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return 0
    return next((int(line.split()[1]) for line in lines if line.startswith("VmRSS")), 0)


def _count(pid: int, what: str) -> int:
    try:
        return len(os.listdir(f"/proc/{pid}/{what}"))
    except OSError:
        return 0


class RefusedError(Exception):
    """A response with an error status."""

    def __init__(self, status: int, body: dict) -> None:
        super().__init__(f"{status} {body}")
        self.status, self.body = status, body


class Client:
    """One kept connection; calls that change something are numbered."""

    def __init__(self, port: int, timeout: float = 60, token: str | None = None) -> None:
        """Connect at the first call."""
        self._connection = http.client.HTTPConnection("127.0.0.1", port, timeout=timeout)
        self._token = {} if token is None else {"Authorization": f"Bearer {token}"}
        self._key, self._number = uuid.uuid4().hex, 0

    def close(self) -> None:
        """Disconnect."""
        self._connection.close()

    def get(self, path: str) -> dict | bytes:
        """Return the JSON of a response, or its bytes if it is not JSON."""
        return self._call("GET", path, None, {})

    def post(self, path: str, **fields: object) -> dict:
        """Make a numbered call."""
        self._number += 1
        fields["request"] = {"key": self._key, "number": self._number}
        return self._call("POST", path, json.dumps(fields), {})

    def post_for_tensors(self, path: str, **fields: object) -> dict:
        """Make a numbered call; return the tensors of its response by name, as bytes."""
        self._number += 1
        fields["request"] = {"key": self._key, "number": self._number}
        accept = {"Accept": "application/x-safetensors"}
        return _tensors(self._call("POST", path, json.dumps(fields), accept))

    def _call(self, method: str, path: str, body: str | None, headers: dict) -> dict | bytes:
        self._connection.request(method, path, body, {**self._token, **headers})
        answer = self._connection.getresponse()
        data = answer.read()
        is_json = answer.headers.get_content_type() == "application/json"
        content = json.loads(data) if is_json else data
        if answer.status >= 400:
            raise RefusedError(answer.status, content)
        if is_json and body is not None and "request" in content:
            expected = {"key": self._key, "number": self._number}
            if content["request"] != expected:
                raise AssertionError(f"the answer to {content['request']} came to {expected}")
        return content


def _tensors(file: bytes) -> dict[str, tuple[str, list[int], bytes]]:
    (size,) = struct.unpack_from("<Q", file)
    header = json.loads(file[8 : 8 + size])
    header.pop("__metadata__", None)
    data = file[8 + size :]
    return {
        name: (entry["dtype"], entry["shape"], data[slice(*entry["data_offsets"])])
        for name, entry in header.items()
    }
