import pytest
from httptools import HttpParserError

from gym_server.http_server.head import RequestHead


def head(*lines):
    return RequestHead("\r\n".join([*lines, "", ""]).encode())


UPGRADE = ("Host: a", "Upgrade: h2c")


@pytest.mark.parametrize(
    ("wishes", "keep_alive"),
    [
        (["Connection: upgrade"], True),
        (["Connection: close, upgrade"], False),
        (["Connection: Upgrade ,keep-alive"], True),
        (["Connection: upgrade", "Connection: close"], False),
    ],
)
def test_a_wish_for_another_protocol_leaves_the_wish_to_close(wishes, keep_alive):
    assert head("GET / HTTP/1.1", *UPGRADE, *wishes).keep_alive is keep_alive


def test_a_wish_for_another_protocol_leaves_the_body():
    more = ("Connection: upgrade", "Expect: 100-continue", "Content-Length: 2")
    asked = head("POST / HTTP/1.1", *UPGRADE, *more)
    assert (asked.body_bytes, asked.expects) == (2, True)


def test_a_head_has_at_most_100_lines():
    assert head("GET / HTTP/1.1", *["A: b"] * 100).environ["HTTP_A"] == ",".join("b" * 100)
    with pytest.raises(HttpParserError, match="more than 100 lines"):
        head("GET / HTTP/1.1", *["A: b"] * 101)


@pytest.mark.parametrize(
    "lines",
    [
        ["CONNECT a:80 HTTP/1.1"],
        ["PRI * HTTP/2.0"],
        ["GET / HTTP/1.1\n"],
        ["GET / HTTP/1.1\n\nGET / HTTP/1.1"],
        ["GET / HTTP/1.1", "A: b\n"],
        ["GET / HTTP/1.1", "A: b\nC: d"],
        ["GET http://[x HTTP/1.1"],
        ["\0"],
    ],
    ids=repr,
)
def test_what_is_no_head_is_refused(lines):
    with pytest.raises(HttpParserError):
        head(*lines)


def test_nothing_waits_for_the_garbage_collection():
    read = head("GET / HTTP/1.1")
    assert read._parser is None
