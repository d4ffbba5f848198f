"""A real server with a token, at addresses and names that others can reach."""

import http.client
import json
import os
import subprocess
from contextlib import closing

import pytest
from conftest import ON_A_FREE_PORT, TOKEN, ServerProcess

from gym_server.cli import main

pytestmark = pytest.mark.slow


@pytest.fixture
def token_file(tmp_path):
    file = tmp_path / "token"
    file.write_text(TOKEN + "\n")
    file.chmod(0o600)
    return file


@pytest.fixture(scope="module")
def locked():
    """Start a server with the token of the environment variable."""
    server = ServerProcess(*ON_A_FREE_PORT, stderr=subprocess.DEVNULL, GYM_SERVER_TOKEN=TOKEN)
    yield server
    server.kill()


def ask(server, method="GET", path="/v1/health/", body=None, token=TOKEN, **headers):
    """Return the status and the response."""
    if token is not None:
        headers["Authorization"] = f"Bearer {token}"
    with closing(http.client.HTTPConnection("127.0.0.1", server.port, timeout=30)) as connection:
        connection.request(method, path, json.dumps(body) if body else None, headers)
        answer = connection.getresponse()
        return answer.status, json.loads(answer.read() or "null")


def test_a_token_from_a_file_opens_a_server_that_others_can_reach(serve, token_file):
    token_file.chmod(0o644)
    server = serve("--host", "0.0.0.0", "--token-file", str(token_file))
    assert ask(server)[0] == 200
    assert ask(server, token=None)[0] == 401
    assert ask(server, token=TOKEN + "x")[0] == 401
    assert ask(server, "POST", "/v1/shutdown/", token=None)[0] == 401
    assert ask(server, "POST", "/v1/shutdown/")[0] == 200
    status, output, errors = server.stop(how=None)
    assert (status, TOKEN in output + errors) == (0, False)
    # Everybody on this machine could read the file.
    assert ("chmod 600" in errors) == (os.name == "posix")


def test_a_token_from_the_variable_is_asked_for_on_loopback_too(locked):
    assert ask(locked)[0] == 200
    assert ask(locked, token=None)[0] == 401


def test_who_shows_no_token_gets_one_answer_a_connection(locked):
    paths = {"/v1/health/": 401, "/v1/envs/00000000/watch/watch.js": 200}
    for path, status in paths.items():
        for token, closes in ((None, "close"), (TOKEN, None)):
            headers = {} if token is None else {"Authorization": f"Bearer {token}"}
            with closing(locked.connect()) as connection:
                connection.request("GET", path, headers=headers)
                answer = connection.getresponse()
                assert answer.status == (status if token is None else 200)
                assert answer.headers["Connection"] == closes


def test_no_auth_says_that_the_variable_is_not_meant(serve):
    server = serve("--host", "0.0.0.0", "--no-auth", GYM_SERVER_TOKEN=TOKEN)
    assert ask(server, token=None)[0] == 200
    assert names_a_path_too_many(server)
    assert server.stop()[0] == 0


@pytest.mark.parametrize(
    ("text", "options", "words"),
    [
        ("short", [], "16 to 1,024"),
        ("", [], "16 to 1,024"),
        (TOKEN, ["--no-auth"], "exclude each other"),
        (None, [], "cannot be read"),
    ],
)
def test_a_token_that_will_not_do_is_one_line_and_status_1(
    token_file, capsys, text, options, words
):
    token_file.unlink() if text is None else token_file.write_text(text)
    assert main.main(["--port", "0", "--token-file", str(token_file), *options]) == 1
    errors = capsys.readouterr().err
    assert errors.count("\n") == 1 and words in errors
    assert TOKEN not in errors


def test_there_is_no_option_for_the_token_itself(capsys):
    # Everybody can see the arguments of a process.
    for words in (["--token", TOKEN], [f"--token={TOKEN}"]):
        with pytest.raises(SystemExit):
            main.main(words)
        errors = capsys.readouterr().err
        assert TOKEN not in errors and "--token-file" in errors


@pytest.mark.parametrize("name", ["https://gym.example.org", "gym.example.org/", "", "a b", "*"])
def test_a_host_that_is_no_name_is_refused(name, capsys):
    with pytest.raises(SystemExit):
        main.main(["--port", "0", "--allow-host", name])
    assert "neither NAME nor NAME:PORT" in capsys.readouterr().err


def test_pages_and_other_names_are_refused_by_a_server_without_a_token(serve):
    server = serve("--allow-host", "gym.example.org")
    for headers, status in (
        ({"Host": "gym.example.org"}, 200),
        ({"Host": "gym.example.org", "Origin": "https://gym.example.org"}, 200),
        ({"Host": "localhost:9"}, 200),
        ({"Host": "evil.example"}, 403),
        ({"Origin": "https://evil.example"}, 403),
        ({"Sec-Fetch-Site": "cross-site"}, 403),
    ):
        assert ask(server, token=None, **headers)[0] == status, headers


def names_a_path_too_many(server):
    """Return whether a server refuses an argument because it may be a path."""
    body = {"env_id": "Ant-v5", "kwargs": {"xml_file": "/no/such.xml"}}
    return "may be a path" in ask(server, "POST", "/v1/envs/", body)[1]["message"]


def test_kwargs_name_files_where_nobody_else_is_served(serve, shared, locked):
    assert not names_a_path_too_many(shared)
    assert not names_a_path_too_many(locked)
    of_a_front = serve(GYM_SERVER_TOKEN=TOKEN, GYM_SERVER_SHARED_ACCOUNT="1")
    assert names_a_path_too_many(of_a_front)


def test_http_1_0_needs_no_host(shared):
    with shared.socket() as connection:
        connection.sendall(b"GET /v1/health/ HTTP/1.0\r\n\r\n")
        assert connection.recv(1000).startswith(b"HTTP/1.1 200")
    with shared.socket() as connection:
        connection.sendall(b"GET /v1/health/ HTTP/1.1\r\n\r\n")
        assert connection.recv(1000).startswith(b"HTTP/1.1 400")
