import os
import socket

import pytest
from front_process import TOKENS, write_users

from gym_server.cli import main

pytestmark = pytest.mark.skipif(os.name != "posix", reason="fronts are for Linux and macOS")


@pytest.fixture
def refused(tmp_path, capsys, monkeypatch):
    """Start a front that cannot start; return the only line that it prints."""
    # Also where root runs this.
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    file = write_users(tmp_path / "users", **TOKENS)

    def refused(*options, port=0):
        assert main.main(["--port", str(port), "--users", str(file), *options]) == 1
        output, errors = capsys.readouterr()
        assert output == "" and errors.count("\n") == 1
        for token in TOKENS.values():
            assert token not in errors
        return errors

    refused.file = file
    return refused


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--no-auth"], "excludes --no-auth"),
        (["--token-file", "x"], "--token-file"),
        (["--allow-module", "os"], "under one account"),
        (["--max-memory-mb", "100"], "use a larger --max-memory-mb"),
        (["--monitor-dir", __file__], "cannot be used"),
    ],
)
def test_options_that_do_not_go_together_are_one_line_with_the_fix(refused, options, words):
    assert words in refused(*options)


def test_a_users_file_that_others_can_read_is_one_line_with_the_fix(refused):
    refused.file.chmod(0o644)
    assert f"chmod 600 {refused.file}" in refused()


@pytest.mark.slow
def test_a_port_that_is_taken_is_one_line_with_the_fix(refused):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        assert "--port 0 picks a free port" in refused(port=taken.getsockname()[1])
