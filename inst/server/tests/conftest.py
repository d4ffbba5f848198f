import contextlib
import http.client
import json
import os
import signal
import socket
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import pytest

from gym_server.api.app import Config, create_app
from gym_server.manager.limits import Limits

TESTS = Path(__file__).parent
SERVER = TESTS.parent


@pytest.fixture
def monitor_dir(tmp_path):
    directory = tmp_path / "monitors"
    directory.mkdir()
    return directory.resolve()


@pytest.fixture
def app(monitor_dir):
    app = create_app(Config(monitor_dir=monitor_dir, allowed_modules=["faulty_envs"]))
    yield app
    app.close()


@pytest.fixture
def quick():
    """Return a function that makes an application with its own limits."""
    apps = []

    def quick(**limits):
        apps.append(create_app(Config(allowed_modules=["faulty_envs"], limits=Limits(**limits))))
        return apps[-1]

    yield quick
    for app in apps:
        app.close()


def created(client, env_id="faulty_envs:Counting-v0", **fields):
    """Make an instance, and return its URL."""
    answer = client.post("/v1/envs/", json={"env_id": env_id, **fields})
    assert answer.status_code == 200, answer.json
    return f"/v1/envs/{answer.json['instance_id']}"


@pytest.fixture
def client(app):
    return app.test_client()


@pytest.fixture
def create(client):
    """Make an instance, and return its URL."""

    def create(env_id="CartPole-v1", **fields):
        answer = client.post("/v1/envs/", json={"env_id": env_id, **fields})
        assert answer.status_code == 200, answer.json
        return f"/v1/envs/{answer.json['instance_id']}"

    return create


@pytest.fixture
def faulty(create):
    return lambda name, **kwargs: create(f"faulty_envs:{name}-v0", kwargs=kwargs)


@pytest.fixture
def sub_envs(create):
    """Make a vector instance of an environment whose infos vary."""

    def sub_envs(space="Box", num_envs=3, name="Uneven", longest=4, **fields):
        kwargs = {"space": space, "longest": longest}
        return create(f"faulty_envs:{name}-v0", num_envs=num_envs, kwargs=kwargs, **fields)

    return sub_envs


class ServerProcess:
    """A real server in its own process.

    Constants of its modules can be changed, so that tests need not wait for long limits:
    ``limits={"gym_server.cli.main._GRACE_SECONDS": 1}``.
    """

    def __init__(self, *arguments, limits=None, stderr=subprocess.PIPE, **variables):
        environment = {
            **os.environ,
            **variables,
            "PYTHONPATH": os.pathsep.join(
                [str(SERVER), str(TESTS), variables.get("PYTHONPATH", "")]
            ),
            "PYTHONDONTWRITEBYTECODE": "1",
        }
        program = ["-m", "gym_server"]
        if limits is not None:
            program = [str(TESTS / "serve_with_limits.py"), json.dumps(limits)]
        self.process = subprocess.Popen(
            [sys.executable, *program, *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=stderr,
            env=environment,
            text=True,
        )
        self.first_line = self.process.stdout.readline()
        self.port = int(self.first_line.rsplit(":", 1)[1]) if self.first_line else None

    def connect(self):
        return http.client.HTTPConnection("127.0.0.1", self.port, timeout=30)

    def socket(self):
        return socket.create_connection(("127.0.0.1", self.port), timeout=30)

    def post(self, path, body=None):
        return self._call("POST", path, json.dumps(body or {}))

    def get(self, path):
        return self._call("GET", path)

    def _call(self, method, path, body=None):
        connection = self.connect()
        try:
            connection.request(method, path, body)
            answer = connection.getresponse()
            return answer.status, json.loads(answer.read() or "null")
        finally:
            connection.close()

    def create(self, env_id, **fields):
        status, answer = self.post("/v1/envs/", {"env_id": env_id, **fields})
        assert status == 200, answer
        return f"/v1/envs/{answer['instance_id']}"

    def takes_no_more(self):
        """Return whether it accepts no more connections, which is the first step of a stop."""
        try:
            self.socket().close()
        except ConnectionError:
            return True
        return False

    def stop(self, how=signal.SIGTERM, timeout=30):
        """Stop it; return exit status, standard output and standard error."""
        if how is not None:
            self.process.send_signal(how)
        output = self.process.communicate(timeout=timeout)
        return self.process.returncode, *output

    def kill(self):
        self.process.kill()
        self.process.wait()
        for pipe in filter(None, (self.process.stdin, self.process.stdout, self.process.stderr)):
            pipe.close()


ON_A_FREE_PORT = ("--port", "0", "--allow-module", "faulty_envs")

# Limits of a server that waits only a second for hanging calls when it stops.
SHORT_GRACE = {"gym_server.cli.main._GRACE_SECONDS": 1, "gym_server.cli.main._LAST_SECONDS": 1}


@pytest.fixture
def serve():
    """Start a server on a free port, and stop it after the test."""
    servers = []

    def serve(*arguments, **how):
        servers.append(ServerProcess(*ON_A_FREE_PORT, *arguments, **how))
        return servers[-1]

    yield serve
    for server in servers:
        server.kill()


@pytest.fixture(scope="module")
def _server_of_a_file():
    # Nobody reads its log, which would fill the pipe.
    server = ServerProcess(*ON_A_FREE_PORT, stderr=subprocess.DEVNULL)
    yield server
    server.kill()


@pytest.fixture
def shared(_server_of_a_file):
    """Return a server that the tests of a file share; it has no instances at the start of each."""
    yield _server_of_a_file
    for instance_id in _server_of_a_file.get("/v1/envs/")[1]["all_envs"]:
        _server_of_a_file.post(f"/v1/envs/{instance_id}/close/")


class Gate:
    """Blocks the environment ``Gated`` until the test opens it."""

    def __init__(self, directory):
        self._begun, self._open = directory / "begun", directory / "open"
        self.kwargs = {"directory": str(directory)}

    def is_reached(self):
        return self._begun.exists()

    def open(self):
        self._open.touch()


@pytest.fixture
def gate(tmp_path):
    """Return a gate, and open it after the test."""
    directory = tmp_path / "gate"
    directory.mkdir()
    gate = Gate(directory)
    yield gate
    gate.open()


TOKEN = "correct-horse-battery"


@pytest.fixture(scope="session")
def attacked(tmp_path_factory):
    """Return one server for all attacks."""
    root = tmp_path_factory.mktemp("attacked")
    server = ServerProcess(
        *ON_A_FREE_PORT,
        *("--monitor-dir", str(root / "runs")),
        GYM_SERVER_TOKEN=TOKEN,
        GYM_SERVER_SHARED_ACCOUNT="1",
    )
    server.root = root
    yield server
    server.kill()


@pytest.fixture
def ask(attacked):
    """Send requests with the token; afterwards the server must still be well."""

    def ask(method, path, body=None):
        connection = attacked.connect()
        with contextlib.closing(connection):
            text = body if isinstance(body, str) or body is None else json.dumps(body)
            connection.request(method, path, text, {"Authorization": f"Bearer {TOKEN}"})
            answer = connection.getresponse()
            return answer.status, json.loads(answer.read() or "null")

    yield ask
    assert ask("GET", "/v1/health/")[0] == 200
    assert attacked.process.poll() is None


@pytest.fixture
def eventually():
    """Wait until a condition is true."""

    def eventually(condition, seconds=10):
        end = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < end, "it never came true"
            time.sleep(0.01)

    return eventually


@pytest.fixture
def watch(app):
    """Return the instance of a URL, and a function that counts its frames."""

    def watch(url):
        instance = app._instances.get(url.rsplit("/", 1)[1])
        drawn = []
        draw = instance.draw

        def counting(sub_env):
            drawn.append(sub_env)
            return draw(sub_env)

        instance.draw = counting
        return instance, drawn

    return watch


@pytest.fixture(scope="module")
def child():
    """Return a function that calls another one in a process that may load PyTorch.

    It is a process of its own, as it is for users: PyTorch may crash where other tests have loaded
    libraries that draw. There is one for all tests of a file, because PyTorch takes seconds to
    import. It computes in one thread, as several wait for each other on a busy machine.
    """
    with ProcessPoolExecutor(
        1,
        mp_context=get_context("spawn"),
        initializer=os.putenv,
        initargs=("OMP_NUM_THREADS", "1"),
    ) as pool:
        yield lambda *call, **kwargs: pool.submit(*call, **kwargs).result()
