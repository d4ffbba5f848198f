import tracemalloc

import pytest

from gym_server.budget import Budget
from gym_server.http_server.request_parser import RequestParser
from gym_server.response import Response

pytestmark = pytest.mark.slow

CHUNKED = b"POST / HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked\r\n\r\n"


def refuse(status, reason):
    return Response(status, reason.encode())


@pytest.fixture
def sent():
    return []


@pytest.fixture
def parser(sent):
    return RequestParser(2**20, sent.append, lambda request: None, Budget(2**20).share(), refuse)


def test_a_body_in_small_chunks_takes_its_own_size(parser):
    parser.feed(CHUNKED)
    tracemalloc.start()
    for _ in range(2**8):
        parser.feed(b"2\r\nab\r\n" * 2**10)
    size, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert size < 1.5 * 2**19
    (request,) = parser.feed(b"0\r\n\r\n")
    assert bytes(request.body) == b"ab" * 2**18


def test_a_body_in_one_piece_is_not_copied(parser):
    body = b"x" * 1000
    (request,) = parser.feed(b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 1000\r\n\r\n" + body)
    assert bytes(request.body) is request.body
    assert request.body == body


def test_requests_without_a_large_body_take_no_memory(sent):
    parser = RequestParser(2**20, sent.append, lambda request: None, Budget(0).share(), refuse)
    (request,) = parser.feed(CHUNKED + b"ffff\r\n" + bytes(0xFFFF) + b"\r\n0\r\n\r\n")
    assert request.refusal is None


UPGRADE = b"%s / HTTP/1.1\r\nHost: a\r\nUpgrade: h2c\r\nConnection: %s\r\n%s\r\n"


@pytest.mark.parametrize(
    ("wishes", "keep_alive"),
    [(b"upgrade", True), (b"close, upgrade", False), (b"Upgrade ,keep-alive", True)],
)
def test_close_stays_when_the_wish_for_another_protocol_is_dropped(parser, wishes, keep_alive):
    (request,) = parser.feed(UPGRADE % (b"GET", wishes, b""))
    assert request.keep_alive is keep_alive


def test_the_wish_to_close_may_be_a_header_of_its_own(parser):
    (request,) = parser.feed(UPGRADE % (b"GET", b"upgrade", b"Connection: close\r\n"))
    assert not request.keep_alive


def test_a_client_that_asks_before_it_sends_is_answered_once_to_go_on(parser, sent):
    more = b"Expect: 100-continue\r\nContent-Length: 2\r\n"
    assert parser.feed(UPGRADE % (b"POST", b"upgrade", more)) == []
    assert sent == [b"HTTP/1.1 100 Continue\r\n\r\n"]
    (request,) = parser.feed(b"{}")
    assert request.body == b"{}"


def test_a_head_has_at_most_100_lines(parser):
    (request,) = parser.feed(b"GET / HTTP/1.1\r\n" + b"a: b\r\n" * 100 + b"\r\n")
    assert request.refusal is None and len(request.headers) == 100
    (request,) = parser.feed(b"GET / HTTP/1.1\r\n" + b"a:\r\n" * 1000)
    assert request.refusal.status == 400 and b"more than 100 lines" in request.refusal.body
    assert len(request.headers) == 101


@pytest.mark.parametrize("begun", [b"GET / HTTP/1.1\r\nX: ", b"GET /"], ids=["header", "URL"])
def test_a_head_that_comes_in_pieces_is_no_larger_for_that(parser, begun):
    piece = b"y" * 40_000
    assert parser.feed(begun + piece) == []
    (request,) = parser.feed(piece + (b"\r\n\r\n" if b"X" in begun else b" HTTP/1.1\r\n\r\n"))
    assert request.refusal.status == 400 and b"65536 bytes" in request.refusal.body
