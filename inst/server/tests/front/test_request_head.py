import subprocess
import sys
from pathlib import Path

import pytest

from gym_server.front.request_head import LARGEST_BYTES, BadHeadError, read_head


def head(*lines, first="GET /v1/envs/ HTTP/1.1"):
    return "\r\n".join([first, "Host: x", *lines, "", ""]).encode()


def test_the_token_and_the_key_are_read():
    found = read_head(head("aUTHorization:  bearer  abc ") + b"body")
    assert (found.method, found.path, found.token) == ("GET", "/v1/envs/", b"abc")
    found = read_head(b"\r\n" + head(first="GET /v1/envs/1/watch/?a=1&key=ro%2Dute.x HTTP/1.0"))
    assert (found.token, found.key) == (None, "ro-ute.x")


@pytest.mark.parametrize(
    "lines",
    [
        ["Authorization: Basic abc"],
        ["Authorization: abc"],
        ["Authorization: Bearer a", "Authorization: Bearer b"],
        ["X-Authorization: Bearer a"],
    ],
)
def test_what_is_no_token_is_none(lines):
    assert not read_head(head(*lines)).token


def test_a_head_may_arrive_byte_by_byte():
    whole = head("Authorization: Bearer abc")
    for end in range(len(whole)):
        assert read_head(whole[:end]) is None
    assert read_head(whole).token == b"abc"


@pytest.mark.parametrize(
    "data",
    [
        b"\x16\x03\x01\x02",
        b"get / HTTP/1.1\r\n\r\n",
        b"GET / HTTP/2.0\r\n\r\n",
        b"GET /\r\n\r\n",
        b"GET / x HTTP/1.1\r\n\r\n",
        b"GET /" + b"x" * LARGEST_BYTES,
        head("X: " + "x" * LARGEST_BYTES, "Authorization: Bearer abc"),
    ],
)
def test_what_is_no_head_or_too_long_is_refused(data):
    with pytest.raises(BadHeadError):
        read_head(data)


def test_the_front_imports_nothing_but_the_standard_library():
    code = (
        "import sys; import gym_server.front.front; "
        "names = {name.partition('.')[0] for name in sys.modules}; "
        "print(*sorted(names - sys.stdlib_module_names))"
    )
    server = Path(__file__).parents[2]
    found = subprocess.run([sys.executable, "-S", "-c", code], cwd=server, capture_output=True)
    assert found.stdout.decode().split() == ["__main__", "gym_server"], found.stderr
