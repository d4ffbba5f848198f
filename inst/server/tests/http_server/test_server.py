"""The server as its clients' sockets see it."""

import json
import os
import re
import socket
import struct
import sys
import threading
import time

import pytest
from raw_http import answered, read_answer, request

from gym_server.http_server.server import bind

pytestmark = pytest.mark.slow


def step(url, number, key="k"):
    body = json.dumps({"action": 0, "request": {"key": key, "number": number}}).encode()
    return request("POST", f"{url}/step/", body)


@pytest.fixture
def server(shared):
    return shared


def gated(server, gate):
    """Make an environment whose steps wait at the gate; return its URL."""
    url = server.create("faulty_envs:Gated-v0", kwargs={**gate.kwargs, "length": 100})
    server.post(f"{url}/reset/")
    return url


def test_a_port_belongs_to_one_server():
    first = bind("127.0.0.1", 0)
    with first, pytest.raises(OSError):
        bind("127.0.0.1", first.getsockname()[1])


def test_a_connection_is_kept_also_after_204_and_errors(server):
    with server.socket() as connection:
        for _ in range(2):
            made = answered(connection, request("POST", "/v1/envs/", b'{"env_id":"CartPole-v1"}'))
            url = f"/v1/envs/{json.loads(made[2])['instance_id']}"
            for path, status in ((f"{url}/close/", 204), (f"{url}/close/", 400), ("/v2", 404)):
                answer = answered(connection, request("POST", path))
                assert answer[0] == status
                assert "connection" not in answer[1]


def test_a_client_that_wants_the_connection_closed_gets_it_closed(server):
    with server.socket() as connection:
        answer = answered(connection, request("GET", "/v1/health/", b"", "Connection: close"))
        assert answer[1]["connection"] == "close"
        assert connection.recv(1) == b""


def test_header_and_body_come_in_one_packet(server):
    with server.socket() as connection:
        answers = [answered(connection, request("GET", "/v1/envs/")) for _ in range(20)]
    assert [packets for *_, packets in answers] == [1] * 20


def test_a_chunked_body_is_read(server):
    body = b'{"env_id":"CartPole-v1"}'
    chunks = b"".join(b"%x\r\n%s\r\n" % (len(part), part) for part in (body[:7], body[7:]))
    with server.socket() as connection:
        sent = request("POST", "/v1/envs/", chunks + b"0\r\n\r\n", "Transfer-Encoding: chunked")
        assert answered(connection, sent)[0] == 200


def test_a_client_may_ask_before_it_sends(server):
    body = b'{"env_id":"CartPole-v1"}'
    head = request("POST", "/v1/envs/", b"", "Expect: 100-continue", f"Content-Length: {len(body)}")
    head = head.replace(b"Content-Length: 0\r\n", b"")
    with server.socket() as connection:
        connection.sendall(head)
        assert connection.recv(1000).startswith(b"HTTP/1.1 100")
        assert answered(connection, body)[0] == 200


@pytest.mark.parametrize("megabytes", [17, 64])
def test_an_enormous_body_is_413_in_json_for_a_client_that_sends_all_of_it(server, megabytes):
    with server.socket() as connection:
        status, headers, body, _ = answered(
            connection, request("POST", "/v1/envs/", b" " * megabytes * 2**20)
        )
    assert (status, headers["content-type"]) == (413, "application/json")
    assert json.loads(body)["code"] == "body_too_large"


def test_an_enormous_chunked_body_is_413_in_json(server):
    chunk = b"%x\r\n%s\r\n" % (2**20, b" " * 2**20)
    with server.socket() as connection:
        sent = request("POST", "/v1/envs/", chunk * 20 + b"0\r\n\r\n", "Transfer-Encoding: chunked")
        assert answered(connection, sent)[0] == 413


def test_an_enormous_body_is_refused_before_it_is_sent_to_a_client_that_asks(server):
    with server.socket() as connection:
        head = b"POST /v1/envs/ HTTP/1.1\r\nHost: 127.0.0.1\r\nExpect: 100-continue\r\n"
        connection.sendall(head + b"Content-Length: 99000000\r\n\r\n")
        assert read_answer(connection)[0] == 413


def test_what_is_no_http_is_400_in_json(server):
    with server.socket() as connection:
        status, headers, body, _ = answered(connection, b"GET / HTTP/1.1\r\nbad header\r\n\r\n")
    assert (status, headers["content-type"]) == (400, "application/json")
    assert json.loads(body)["message"]


def test_requests_sent_at_once_are_answered_in_order(server):
    paths = ["/v1/envs/", "/v1/health/", "/nowhere", "/v1/envs/"]
    with server.socket() as connection:
        connection.sendall(b"".join(request("GET", path) for path in paths))
        connection.shutdown(socket.SHUT_WR)
        with connection.makefile("rb") as answers:
            text = answers.read().decode()
    assert re.findall(r"HTTP/1.1 (\d+)", text) == ["200", "200", "404", "200"]
    assert text.index("all_envs") < text.index("versions") < text.index("not_found")


def test_a_request_that_comes_byte_by_byte_is_read(server):
    with server.socket() as connection:
        for byte in request("POST", "/v1/envs/", b'{"env_id":"CartPole-v1"}'):
            connection.sendall(bytes([byte]))
        assert read_answer(connection)[0] == 200


def test_an_upgrade_is_declined_and_the_request_answered(server):
    headers = ("Connection: Upgrade, HTTP2-Settings", "Upgrade: h2c", "HTTP2-Settings: AAMAAABk")
    with server.socket() as connection:
        for sent in (
            request("GET", "/v1/health/", b"", *headers),
            request("POST", "/v1/envs/", b'{"env_id":"CartPole-v1"}', *headers),
            request("GET", "/v1/health/"),
        ):
            assert answered(connection, sent)[0] == 200


def test_a_proxys_request_is_refused_and_the_server_goes_on(server):
    with server.socket() as connection:
        answer = answered(connection, b"CONNECT a:80 HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        assert (answer[0], connection.recv(1)) == (400, b"")
    assert server.get("/v1/health/")[0] == 200


def test_a_url_that_is_none_is_400_in_json(server):
    with server.socket() as connection:
        status, headers, _, _ = answered(connection, request("GET", "http://[x"))
    assert (status, headers["content-type"]) == (400, "application/json")


@pytest.mark.skipif(sys.platform != "linux", reason="prlimit() and /proc")
def test_a_server_without_file_handles_says_so_and_goes_on(serve):
    import resource

    server = serve()
    pid = server.process.pid
    _, hard = resource.prlimit(pid, resource.RLIMIT_NOFILE)
    opened = len(os.listdir(f"/proc/{pid}/fd"))
    resource.prlimit(pid, resource.RLIMIT_NOFILE, (opened + 3, hard))
    connections = [server.socket() for _ in range(10)]
    warning = server.process.stderr.readline()
    for connection in connections:
        connection.close()
    assert "no more files" in warning
    assert server.get("/v1/health/")[0] == 200


def test_http_1_0_is_answered_and_closed(server):
    with server.socket() as connection:
        assert answered(connection, b"GET /v1/health/ HTTP/1.0\r\n\r\n")[0] == 200
        assert connection.recv(1) == b""


def test_a_head_request_gets_no_body(server):
    with server.socket() as connection:
        connection.sendall(request("HEAD", "/v1/health/") + request("GET", "/v1/envs/"))
        data = b""
        while b"all_envs" not in data:
            data += connection.recv(65536)
    assert b"versions" not in data


def test_a_url_with_its_host_is_that_of_its_path(server):
    with server.socket() as connection:
        sent = request("GET", f"http://127.0.0.1:{server.port}/v1/registry/?search=MountainCar-v0")
        assert len(json.loads(answered(connection, sent)[2])["environments"]) == 1


@pytest.mark.parametrize("endless", [b"GET /", b"GET / HTTP/1.1\r\nA: ", b"GET / HTTP/1.1\r\n"])
def test_a_head_without_an_end_is_400_in_json(server, endless):
    more = b"B: c\r\n" if endless.endswith(b"\n") else b"x"
    with server.socket() as connection:
        connection.sendall(endless + more * (70_000 // len(more)))
        status, headers, body, _ = read_answer(connection)
        assert (status, headers["content-type"]) == (400, "application/json")
        assert "head" in json.loads(body)["message"]


def test_trailers_without_an_end_are_400(server):
    with server.socket() as connection:
        connection.sendall(request("POST", "/v1/envs/", b"0\r\nA: ", "Transfer-Encoding: chunked"))
        connection.sendall(b"x" * 140_000)
        assert read_answer(connection)[0] == 400


def test_a_header_with_an_underscore_is_no_other_header(server):
    sent = request("POST", "/v1/upload/", b"{", "Transfer_Encoding: chunked", "Expect_: a")
    with server.socket() as connection:
        assert json.loads(answered(connection, sent)[2])["code"] == "malformed_json"
    step = request("POST", "/v1/envs/0/step/", b"{}", "Content_Type: application/x-safetensors")
    with server.socket() as connection:
        assert json.loads(answered(connection, step)[2])["code"] == "missing_parameter"


def test_a_request_repeated_after_the_connection_broke_is_done_once(server, gate, eventually):
    url = gated(server, gate)
    with server.socket() as connection:
        connection.sendall(step(url, 1))
        eventually(gate.is_reached)
        # Close with a reset, like a network that fails.
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    with server.socket() as connection:
        connection.sendall(step(url, 1))
        gate.open()
        repeated = read_answer(connection)
        again = answered(connection, step(url, 1))
    assert repeated[2] == again[2]
    assert json.loads(again[2])["observation"] == [1]
    assert server.get(url)[1]["steps"] == 1


def test_repetitions_that_arrive_while_the_first_runs_are_done_once(server, gate, eventually):
    url = gated(server, gate)
    connections = [server.socket() for _ in range(5)]
    for connection in connections:
        connection.sendall(step(url, 1))
    eventually(gate.is_reached)
    # Time for the others to come; the test is also valid for one that comes later.
    time.sleep(0.05)
    gate.open()
    bodies = {read_answer(connection)[2] for connection in connections}
    assert len(bodies) == 1
    assert server.get(url)[1]["steps"] == 1
    for connection in connections:
        connection.close()


def test_many_clients_are_served_at_the_same_time(server, tmp_path):
    kwargs = {"directory": str(tmp_path), "count": 16}
    urls = [server.create("faulty_envs:Meeting-v0", kwargs=kwargs) for _ in range(16)]
    for url in urls:
        server.post(f"{url}/reset/")
    connections = [server.socket() for _ in urls]
    for connection, url in zip(connections, urls, strict=True):
        connection.sendall(step(url, 1, key=url[-8:]))
    for connection in connections:
        assert read_answer(connection)[0] == 200
        connection.close()


# How long the server waits, at the stop, for a client that has sent half a request.
SOON_DROPPED = {"gym_server.http_server.server._HALF_SENT_SECONDS": 0.5}


def test_idle_and_silent_clients_hold_nobody_up(serve):
    server = serve(limits=SOON_DROPPED)
    idle = [server.socket() for _ in range(100)]
    for connection in idle[:50]:
        answered(connection, request("GET", "/v1/health/"))
    idle[60].sendall(b"POST /v1/envs/ HTTP/1.1\r\nContent-Le")
    assert server.get("/v1/health/")[0] == 200
    # Less than a request in progress may take.
    assert server.stop(timeout=9)[0] == 0
    for connection in idle:
        connection.close()


@pytest.mark.parametrize("how", ["shutdown", "end of input"])
def test_a_request_under_way_is_answered_in_full_at_the_stop(serve, gate, eventually, how):
    # A server that did not wait for its requests would end soon.
    limits = {"gym_server.cli.main._LAST_SECONDS": 0.1}
    server = serve("--stop-on-stdin-eof", limits=limits)
    url = gated(server, gate)
    with server.socket() as connection:
        connection.sendall(step(url, 1))
        eventually(gate.is_reached)
        if how == "shutdown":
            assert server.post("/v1/shutdown/")[0] == 200
        else:
            server.process.stdin.close()
        eventually(server.takes_no_more)
        time.sleep(0.5)
        gate.open()
        status, _, body, _ = read_answer(connection)
    assert (status, json.loads(body)["observation"]) == (200, [1])
    assert server.process.wait(10) == 0


def test_a_large_answer_under_way_arrives_in_full(serve, eventually):
    server = serve()
    url = server.create("faulty_envs:Counting-v0")
    # Its options are returned, each letter as an escape of six characters.
    options = {"text": "é" * 500_000}
    with socket.socket() as connection:
        # Much smaller than the response, which must wait for this client.
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2**17)
        connection.settimeout(30)
        connection.connect(("127.0.0.1", server.port))
        body = json.dumps({"options": options}, ensure_ascii=False).encode()
        connection.sendall(request("POST", f"{url}/reset/", body))
        assert connection.recv(1, socket.MSG_PEEK)
        server.process.terminate()
        eventually(server.takes_no_more)
        status, _, body, _ = read_answer(connection)
    assert status == 200
    assert json.loads(body)["info"]["options"] == options
    assert server.process.wait(15) == 0


def test_frames_and_closes_of_many_clients_do_not_break_each_other(server):
    failures = []

    def draw_and_close(env_id):
        try:
            for _ in range(2):
                url = server.create(env_id)
                server.post(f"{url}/reset/")
                connection = server.connect()
                connection.request("GET", f"{url}/render/")
                frame = connection.getresponse().read()
                connection.close()
                assert frame.startswith(b"\x89PNG"), frame[:200]
                assert server.post(f"{url}/close/")[0] == 204
        except Exception as failure:
            failures.append(failure)

    ids = ["CartPole-v1", "MountainCar-v0", "Acrobot-v1", "Pendulum-v1"] * 2
    threads = [threading.Thread(target=draw_and_close, args=(env_id,)) for env_id in ids]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures
