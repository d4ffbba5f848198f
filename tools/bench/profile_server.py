"""Time a single step outside R: on the wire, in the server, in Gymnasium, in microseconds.

Reads a line per question and answers with a line of JSON. PAUSE is how long R works between two
requests, in microseconds: code that has slept is slower than in a busy loop.

    record URL             the address of a recording proxy to the server at URL
    recorded               the last request and response, base64
    round_trip PAUSE URL   the recorded step over a plain socket, each with its own key
    echo PAUSE             the same number of bytes to another process and back
    application PAUSE      the recorded step passed to the application, and parts of that
"""

import base64
import json
import random
import re
import socket
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from functools import cache
from urllib.parse import urlsplit
from wsgiref.util import setup_testing_defaults

import gymnasium
from gym_server.api.app import create_app
from gym_server.protocol import answers, bodies
from gym_server.response import Response

_STEPS = 8  # With alternating actions no episode of CartPole ends earlier.
_EPISODES = 100

_recorded: dict[str, bytes] = {}


def timed(
    step: Callable[[int], object],
    wait: Callable[[], object],
    reset: Callable[[], object] = lambda: None,
) -> float:
    """Return the median over episodes of the microseconds of a step after a pause."""
    taken = []
    for _ in range(_EPISODES):
        reset()
        seconds = 0.0
        for i in range(_STEPS):
            wait()
            started = time.perf_counter()
            step(i % 2)
            seconds += time.perf_counter() - started
        taken.append(seconds / _STEPS * 1e6)
    return statistics.median(taken)


def _work(pause: str) -> Callable[[], None]:
    """Return a function that keeps the processor busy, as R does."""

    def work() -> None:
        end = time.perf_counter() + float(pause) / 1e6
        while time.perf_counter() < end:
            pass

    return work


def record(url: str) -> str:
    """Start a proxy that keeps the last request and response."""
    listener = socket.create_server(("127.0.0.1", 0))
    threading.Thread(target=_forward, args=(listener, url), daemon=True).start()
    return f"http://127.0.0.1:{listener.getsockname()[1]}"


def _forward(listener: socket.socket, url: str) -> None:
    client, _ = listener.accept()
    server = _connect(url)
    while True:
        request = _read_message(client)
        server.sendall(request)
        answer = _read_message(server)
        client.sendall(answer)
        _recorded.update(request=request, answer=answer)


def recorded() -> dict[str, str]:
    """Return what the proxy kept."""
    return {name: base64.b64encode(data).decode() for name, data in _recorded.items()}


def round_trip(pause: str, url: str) -> float:
    """Send the recorded step to the server."""
    server = _connect(url)
    requests = _requests()

    def send(request: bytes) -> None:
        server.sendall(request)
        _read_message(server)

    taken = timed(
        lambda action: send(requests(action)),
        _work(pause),
        lambda: send(requests(0).replace(b"/step/", b"/reset/", 1)),
    )
    server.close()
    return taken


def echo(pause: str) -> float:
    """Send as many bytes as a step to a process that answers with as many as the server."""
    request, answer = _recorded["request"], _recorded["answer"]
    script = (
        "import socket; s = socket.create_server(('127.0.0.1', 0));"
        "print(s.getsockname()[1], flush=True); c, _ = s.accept();"
        "c.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)\n"
        f"while c.recv(65536): c.sendall(b'x' * {len(answer)})"
    )
    process = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
    other = _connect(f"http://127.0.0.1:{process.stdout.readline().strip()}")

    def exchange(_: int) -> None:
        other.sendall(request)
        left = len(answer)
        while left:
            left -= len(other.recv(left))

    taken = timed(exchange, _work(pause))
    other.close()
    process.wait()
    return taken


def application(pause: str) -> dict[str, float]:
    """Pass the recorded step to an application in this process."""
    requests = _requests()
    body = requests(1).split(b"\r\n\r\n", 1)[1]
    answer = json.loads(_recorded["answer"].split(b"\r\n\r\n", 1)[1])

    def sleep() -> None:
        time.sleep(float(pause) / 1e6)

    return {
        "whole": timed(
            lambda action: _post("step/", requests(action)), sleep, lambda: _post("reset/")
        ),
        "loads": timed(lambda _: bodies.loads(body), sleep),
        "answer": timed(lambda _: answers.response_to(answer, None), sleep),
        "env": timed(_env.step, sleep, _env.reset),
    }


_app = create_app()
_env = gymnasium.make("CartPole-v1")


@cache
def _instance() -> str:
    body = b'{"env_id": "CartPole-v1"}'
    made = _app.admit(_environ("/v1/envs/", {})).respond(body, lambda: True)
    return json.loads(made.body)["instance_id"]


def _post(what: str, request: bytes = b"\r\n\r\n") -> bytes:
    return _route(what)(request.split(b"\r\n\r\n", 1)[1], lambda: True).body


@cache
def _route(what: str) -> Callable[[bytes, Callable[[], bool]], Response]:
    """Return what answers a body, as the server keeps it for each head."""
    return _app.admit(_environ(f"/v1/envs/{_instance()}/{what}", _headers())).respond


@cache
def _headers() -> dict[str, str]:
    head = _recorded["request"].split(b"\r\n\r\n", 1)[0].decode()
    return dict(line.lower().split(": ", 1) for line in head.split("\r\n")[1:])


def _environ(path: str, headers: dict[str, str]) -> dict:
    environ = {
        "REQUEST_METHOD": "POST",
        "PATH_INFO": path,
        "CONTENT_TYPE": headers.get("content-type", ""),
        "HTTP_ACCEPT": headers.get("accept", ""),
    }
    setup_testing_defaults(environ)
    return environ


def _requests() -> Callable[[int], bytes]:
    """Return a function that returns the recorded step, each with its own key."""
    steps = [_as_step(action) for action in range(2)]
    # Each key has its own numbers, and here they start again.
    key = b"%08x" % random.getrandbits(32)
    steps = [re.sub(rb'("key":")\w{8}', rb"\g<1>" + key, step) for step in steps]
    numbers = iter(range(1000, 10000))
    return lambda action: re.sub(
        rb'("number":)\d{4}', rb"\g<1>%d" % next(numbers), steps[action], count=1
    )


def _connect(url: str) -> socket.socket:
    address = urlsplit(url)
    connection = socket.create_connection((address.hostname, address.port))
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return connection


def _read_message(connection: socket.socket) -> bytes:
    data = b""
    while b"\r\n\r\n" not in data:
        data += connection.recv(65536)
    head, body = data.split(b"\r\n\r\n", 1)
    length = re.search(rb"(?i)\r\ncontent-length: *(\d+)", head)
    left = int(length[1]) - len(body) if length else 0
    while left > 0:
        more = connection.recv(left)
        data += more
        left -= len(more)
    return data


def _as_step(action: int) -> bytes:
    return re.sub(rb'"action":[01]', b'"action":%d' % action, _recorded["request"])


_COMMANDS = {
    "record": record,
    "recorded": recorded,
    "round_trip": round_trip,
    "echo": echo,
    "application": application,
}

for line in sys.stdin:
    command, *arguments = line.split()
    print(json.dumps(_COMMANDS[command](*arguments)), flush=True)
