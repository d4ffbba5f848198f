import os

import pytest

from gym_server.cli.token_file import VARIABLE, find_token
from gym_server.tokens import CannotStartError

TOKEN = "correct-horse-battery"


def written(tmp_path, text, mode=0o600):
    file = tmp_path / "token"
    file.write_bytes(text)
    file.chmod(mode)
    return file


@pytest.mark.parametrize("end", [b"", b"\n", b"\r\n", b"  \n\n"])
def test_a_file_holds_the_token(tmp_path, end):
    assert find_token(written(tmp_path, TOKEN.encode() + end), {}) == TOKEN


def test_the_variable_holds_it_where_there_is_no_file(tmp_path):
    variables = {VARIABLE: f"{TOKEN}-2"}
    assert find_token(None, variables) == f"{TOKEN}-2"
    # Processes that an environment starts do not inherit it.
    assert variables == {}
    variables = {VARIABLE: f"{TOKEN}-2"}
    assert find_token(written(tmp_path, TOKEN.encode()), variables) == TOKEN
    assert variables == {}
    assert find_token(None, {}) is None
    assert find_token(None, {VARIABLE: ""}) is None


@pytest.mark.parametrize(
    "text", [b"", b"short", b"x" * 15, b"two words are too many", b"x" * 2000, b"\xff" * 20]
)
def test_what_is_no_token_is_refused_without_being_shown(tmp_path, text):
    with pytest.raises(CannotStartError) as caught:
        find_token(written(tmp_path, text), {})
    assert "16 to 1,024" in str(caught.value)
    assert not text.strip() or text.decode("latin-1") not in str(caught.value)
    if text:
        with pytest.raises(CannotStartError, match=VARIABLE):
            find_token(None, {VARIABLE: text.decode("latin-1")})


def test_a_file_that_is_not_there_is_an_error_of_the_system(tmp_path):
    with pytest.raises(FileNotFoundError):
        find_token(tmp_path / "none", {})


@pytest.mark.skipif(os.name != "posix", reason="POSIX permissions")
def test_a_file_that_everybody_can_read_is_warned_of(tmp_path, caplog):
    find_token(written(tmp_path, TOKEN.encode(), 0o640), {})
    assert caplog.text == ""
    find_token(written(tmp_path, TOKEN.encode(), 0o644), {})
    assert "chmod 600" in caplog.text and TOKEN not in caplog.text
