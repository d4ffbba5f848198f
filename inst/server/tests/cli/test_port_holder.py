import http.server
import socket
import threading
from contextlib import contextmanager

import pytest
from conftest import TOKEN

from gym_server.cli import main
from gym_server.cli import port_holder as module
from gym_server.cli.port_holder import port_holder

pytestmark = pytest.mark.slow


@pytest.fixture
def refused(capsys):
    """Start a server on a taken port; return the line that it prints."""

    def refused(port):
        assert main.main(["--port", str(port)]) == 1
        output, errors = capsys.readouterr()
        assert (output, errors.count("\n")) == ("", 1)
        assert f"port {port} on 127.0.0.1 cannot be used: " in errors
        assert "--port 0" in errors
        return errors

    return refused


def test_another_gym_server_is_named_with_its_process(serve, refused):
    server = serve()
    said = refused(server.port)
    assert f"a Gym server 1.0.0 (process {server.process.pid}) has it" in said
    assert server.stop()[0] == 0


def test_one_that_asks_for_a_token_is_shown_none(serve, refused, monkeypatch):
    server = serve("--log-level", "info", GYM_SERVER_TOKEN=TOKEN)
    monkeypatch.setenv("GYM_SERVER_TOKEN", TOKEN)
    assert "a Gym server that asks for a token has it" in refused(server.port)
    assert "without a token" in server.stop()[2]


class Stranger(http.server.BaseHTTPRequestHandler):
    def do_GET(self):
        self.send_response(200)
        self.end_headers()
        self.wfile.write(b'{"versions": {"gym_server": 5}, "pid": "x"}')

    def log_message(self, *words):
        pass


@contextmanager
def listening(serve):
    with socket.create_server(("127.0.0.1", 0)) as listener:
        thread = threading.Thread(target=serve, args=(listener,), daemon=True)
        thread.start()
        yield listener.getsockname()[1]


def test_another_program_is_called_so(refused):
    with http.server.HTTPServer(("127.0.0.1", 0), Stranger) as stranger:
        threading.Thread(target=stranger.serve_forever, daemon=True).start()
        assert "another program has it" in refused(stranger.server_port)
        stranger.shutdown()


@pytest.mark.parametrize("says", [b"", b"SSH-2.0-x\r\n", b"HTTP/1.1 200 OK\r\n\r\n[[["])
def test_what_speaks_no_http_is_another_program(says):
    def serve(listener):
        client, _ = listener.accept()
        client.sendall(says)
        client.close()

    with listening(serve) as port:
        assert port_holder("127.0.0.1", port) == "another program has it"


def test_who_never_answers_is_not_waited_for(monkeypatch):
    monkeypatch.setattr(module, "_ANSWER_SECONDS", 0.2)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        assert port_holder("0.0.0.0", silent.getsockname()[1]) == "another program has it"


def test_where_nobody_listens_there_is_nobody():
    with socket.create_server(("127.0.0.1", 0)) as gone:
        port = gone.getsockname()[1]
    assert port_holder("127.0.0.1", port) is None
