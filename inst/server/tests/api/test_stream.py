"""Steps and resets by a WebSocket, on a real server."""

import contextlib
import json
import re
import socket
import struct
from pathlib import Path

import pytest
import raw_http
import stream_client
from faulty_envs import SPACES
from stream_client import ARRAYS, JSON_BODY, RESET, STEP, TENSOR_BODY, StreamClient, frame
from test_fuzz import mutated

from gym_server.protocol import safetensors

PAGE = (Path(__file__).parents[2] / "PROTOCOL.md").read_text(encoding="utf-8")
NUMBERS = (None, "float64")
TENSORS = {"Accept": safetensors.TENSORS}


@pytest.fixture
def opened(shared):
    """Open streams, to a new Counting or to another instance."""
    streams = []

    def opened(url=None, **how):
        url = url or shared.create("faulty_envs:Counting-v0", kwargs={"length": 10**6})
        streams.append(StreamClient(("127.0.0.1", shared.port), url, **how))
        streams[-1].url = url
        return streams[-1]

    yield opened
    for stream in streams:
        stream.close()


def by_http(server, path, **fields):
    """Return the content type and the body of an answer, with tensors where they can be."""
    with contextlib.closing(server.connect()) as connection:
        connection.request("POST", path, json.dumps(fields), TENSORS)
        answer = connection.getresponse()
        return answer.headers["Content-Type"], answer.read()


def data_of(file):
    return file[8 + int.from_bytes(file[:8], "little") :]


def padded(data):
    return data.ljust(max(112, len(data) + -len(data) % 8), b"\0")


@pytest.mark.parametrize("num_envs", [None, 3])
@pytest.mark.parametrize("space", sorted(set(SPACES) - {"nothing"}))
def test_a_stream_says_what_http_says(shared, opened, space, num_envs):
    kwargs = {"space": space, "longest": 3}
    fields = {"kwargs": kwargs, "seed": 1, "num_envs": num_envs}
    ours, theirs = (shared.create("faulty_envs:Uneven-v0", **fields) for _ in range(2))
    stream = opened(ours)
    asked, answers = {"seed": 1}, []
    for what, path in ((RESET, "reset"), *[(STEP, "step")] * 4):
        form, status, content, last = stream.ask(what, JSON_BODY, json.dumps(asked).encode())
        assert status == 200, content
        kind, body = by_http(shared, f"{theirs}/{path}/", **asked)
        if form == ARRAYS:
            # The arrays of a file, without its header.
            assert content == padded(data_of(body))
            info = json.loads(safetensors.read(body).metadata["info"])
            assert (last or {"info": {}}) == {"info": info}
        elif form == TENSOR_BODY:
            assert content == body
        else:
            assert (kind, content) == ("application/json", json.loads(body))
        answers.append(form)
        action = shared.get(f"{theirs}/action_space/sample/")[1]["action"]
        shared.get(f"{ours}/action_space/sample/")
        asked = {"action": action}
    assert set(answers) == {ARRAYS if stream.layout["step"] else answers[0]}


@pytest.mark.parametrize("order", [None, "column"])
def test_arrays_of_actions_are_taken_and_a_mask_selects_sub_environments(shared, opened, order):
    fields = {"num_envs": 3, "seed": 1, "vectorization_mode": "sync"}
    ours, theirs = (shared.create("CartPole-v1", **fields) for _ in range(2))
    stream = opened(ours, order=order)
    stream.reset()
    by_http(shared, f"{theirs}/reset/")
    content = stream.step(0, 1, 1)[2]
    wanted = data_of(by_http(shared, f"{theirs}/step/", action=[0, 1, 1])[1])
    assert (content == padded(wanted)) is (order is None)
    assert stream.layout["step"]["observation"]["shape"] == ([3, 4] if order is None else [4, 3])
    masked = bytes([1, 0, 1, 0, 0, 0, 0, 0]) + struct.pack("<2i", 1, 0)
    content = stream.ask(STEP, ARRAYS, masked, flags=8)[2]
    wanted = by_http(shared, f"{theirs}/step/", action=[1, 0], step_mask=[True, False, True])[1]
    assert sorted(content) == sorted(padded(data_of(wanted)))


@pytest.mark.parametrize("space", ["Box", "bytes", "Discrete"])
@pytest.mark.parametrize("num_envs", [None, 3])
def test_numbers_come_as_float64_where_it_can_represent_all(shared, opened, space, num_envs):
    fields = {"kwargs": {"space": space}, "seed": 1, "num_envs": num_envs}
    found = []
    for numbers in (None, "float64"):
        stream = opened(shared.create("faulty_envs:Uneven-v0", **fields), numbers=numbers)
        reset = stream.arrays(stream.reset()[2], "reset")
        action = shared.get(f"{stream.url}/action_space/sample/")[1]["action"]
        body = json.dumps({"action": action}).encode()
        found.append((reset, stream.arrays(stream.ask(STEP, JSON_BODY, body)[2])))
    assert found[0] == found[1]
    assert {place["dtype"] for place in stream.layout["step"].values()} == {"F64"}
    # This one has larger integers.
    assert opened(numbers="float64").layout["reset"]["observation"]["dtype"] == "I64"


def test_last_observations_of_episodes_come_as_a_file(shared, opened):
    kwargs = {"space": "Box", "longest": 1}
    fields = {"kwargs": kwargs, "num_envs": 2, "autoreset_mode": "SameStep", "seed": 1}
    stream = opened(shared.create("faulty_envs:Uneven-v0", **fields))
    stream.reset()
    action = shared.get(f"{stream.url}/action_space/sample/")[1]["action"]
    body = json.dumps({"action": action}).encode()
    form, _, content, _ = stream.ask(STEP, JSON_BODY, body)
    assert form == TENSOR_BODY and "final_obs" in safetensors.read(content).tensors
    # Without them, and without infos, it is arrays alone.
    assert stream.ask(STEP, JSON_BODY, body, flags=3)[::3] == (ARRAYS, None)


def test_a_number_is_done_once_by_either_way(shared, opened):
    stream = opened()
    stream.reset()
    first = stream.step(1)
    # Again, and by another stream after this one broke.
    assert stream.step(1, number=2) == first
    stream.close()
    again = opened(stream.url)
    assert again.step(1, number=2) == first
    form, status, refusal, _ = again.step(0, number=2)
    assert (form, status, refusal["code"]) == (JSON_BODY, 409, "request_conflict")
    assert again.step(1, number=1)[1] == 409
    # By HTTP.
    request = {"key": "k", "number": 2}
    kind, body = by_http(shared, f"{stream.url}/step/", action=1, request=request)
    assert kind == "application/x-gym-message" and body[stream_client.ANSWER.size :] == first[2]
    by_http(shared, f"{stream.url}/step/", action=1, request={"key": "k", "number": 3})
    form, status, content, _ = again.step(1, number=3)
    observation = safetensors.read(content).tensors["observation"].array()
    assert (form, status, observation.tolist()) == (TENSOR_BODY, 200, [2])
    assert again.arrays(again.step(1, number=4)[2])["observation"] == [3]


def test_a_message_by_http_is_answered_as_by_a_stream(shared, opened):
    fields = {"num_envs": 3, "seed": 1, "vectorization_mode": "sync"}
    ours, theirs = (shared.create("CartPole-v1", **fields) for _ in range(2))
    stream = opened(theirs, order="column")
    path = f"{ours}/stream/?key=k&order=column"
    assert shared.get(path)[1] == stream.layout

    def posted(message):
        with contextlib.closing(shared.connect()) as connection:
            connection.request("POST", path, message)
            answer = connection.getresponse()
            return answer.status, answer.headers["Content-Type"], answer.read()

    actions = struct.pack("<3i", 0, 1, 1)
    for what, form, content, flags in (
        (RESET, JSON_BODY, b"{}", 0),
        (STEP, ARRAYS, actions, 0),
        (STEP, ARRAYS, bytes([1, 0, 1]) + bytes(5) + actions[:8], 8),
    ):
        message = stream.message(what, form, content, flags)
        stream.socket.sendall(frame(message))
        wanted = stream.receive_frame()[1]
        # Asked again it is not done again, and neither is it by a stream.
        for _ in range(2):
            assert posted(message) == (200, "application/x-gym-message", wanted)
    again = opened(ours, order="column")
    again.socket.sendall(frame(message))
    assert again.receive_frame()[1] == wanted
    # What is no array is a response of HTTP.
    for sent, status, code in (
        (message[:-8], 409, "request_conflict"),
        (b"short", 400, "malformed_message"),
        (stream.message(STEP, JSON_BODY, b"{}"), 400, "missing_parameter"),
    ):
        refused, kind, body = posted(sent)
        assert (refused, kind) == (status, "application/json")
        assert json.loads(body)["code"] == code


def test_the_second_stream_takes_over_and_the_first_is_told(opened):
    first = opened()
    first.reset()
    second = opened(first.url)
    assert first.closing() == (4001, "another stream to this environment was opened")
    assert second.step(1, number=5)[1] == 200


def test_errors_are_those_of_http_and_the_stream_goes_on(shared, opened):
    stream = opened()
    assert stream.step(1)[1:3:1][1]["code"] == "reset_needed"
    assert stream.reset(seed=-1)[2]["code"] == "invalid_parameter"
    stream.reset()
    for content, code in (
        (struct.pack("<i", 7), "action_not_in_space"),
        (bytes(3), "malformed_message"),
        (b"", "malformed_message"),
        (bytes(8), "malformed_message"),
    ):
        form, status, answer, _ = stream.ask(STEP, ARRAYS, content)
        assert (form, status, answer["code"]) == (JSON_BODY, 400, code)
    assert stream.ask(STEP, ARRAYS, bytes(8), flags=8)[2]["code"] == "malformed_message"
    assert stream.ask(9)[2]["code"] == stream.ask(STEP, 9)[2]["code"] == "malformed_message"
    assert stream.ask(STEP, JSON_BODY, b"{")[2]["code"] == "malformed_json"
    assert stream.ask(STEP, TENSOR_BODY, b"{")[2]["code"] == "malformed_tensors"
    assert stream.ask(RESET, TENSOR_BODY, b"{")[2]["code"] == "malformed_message"
    assert stream.arrays(stream.step(1)[2])["observation"] == [1]
    shared.post(f"{stream.url}/close/")
    assert stream.step(1)[2]["code"] == "unknown_instance"


@pytest.mark.parametrize(
    ("sent", "code", "words"),
    [
        (frame(b"text", first=0x81), 1003, "binary, not text"),
        (frame(b"half", first=0x02), 1003, "one frame"),
        (frame(b"rest", first=0x80), 1003, "one frame"),
        (frame(bytes(16), first=0xC2), 1002, "means nothing"),
        (frame(bytes(16), first=0x83), 1002, "means nothing"),
        (frame(bytes(200), first=0x89), 1002, "125 bytes"),
        (b"\x82\x10" + bytes(16), 1002, "mask"),
        (b"\x82\xff" + (2**40).to_bytes(8, "big") + bytes(4), 1009, "at most 16777216 bytes"),
        (frame(b"short"), 1003, "at least 16 bytes"),
        (frame(struct.pack("<8xd", 1.5)), 1003, "integer from 0"),
        (frame(struct.pack("<8xd", float("nan"))), 1003, "integer from 0"),
    ],
)
def test_what_is_no_message_ends_the_stream_in_words(opened, sent, code, words):
    stream = opened()
    stream.reset()
    stream.socket.sendall(sent + bytes(100_000))
    told, reason = stream.closing()
    assert told == code and words in reason
    # The instance lives.
    assert opened(stream.url).step(1, number=2)[1] == 200


def test_pings_and_masks_are_as_the_standard_says(opened):
    stream = opened()
    for first in range(0, 10_000, 100):
        stream.socket.sendall(frame(b"ping", first=0x89) * 100)
        for _ in range(first, first + 100):
            assert stream.receive_frame() == (10, b"ping")
    stream.socket.sendall(frame(b"", first=0x8A))
    message = frame(stream.message(RESET), mask=b"abcd")
    for byte in message:
        stream.socket.sendall(bytes([byte]))
    assert stream.answer()[1] == 200
    stream.socket.sendall(frame((1000).to_bytes(2, "big"), first=0x88))
    assert stream.closing()[0] == 1000


def test_only_who_may_use_the_server_opens_a_stream(attacked, ask):
    url = f"/v1/envs/{ask('POST', '/v1/envs/', {'env_id': 'CartPole-v1'})[1]['instance_id']}"
    token = "Authorization: Bearer correct-horse-battery"
    for headers, status in (
        ((), 401),
        ((token, "Origin: http://example.org"), 403),
        ((token, "Sec-Fetch-Site: cross-site", "Sec-Fetch-Mode: websocket"), 403),
        ((token,), 101),
    ):
        opened = StreamClient(("127.0.0.1", attacked.port), url, *headers)
        assert opened.status == status, headers
        opened.close()
    path = f"{url}/stream/"
    foreign = raw_http.request("GET", path, b"", token).replace(b"127.0.0.1", b"example.org")
    for request, status, code in (
        (foreign, 403, "foreign_host"),
        (raw_http.request("GET", path, b"", token, "Upgrade: h2c"), 426, "upgrade_required"),
        (raw_http.request("POST", path, b""), 401, "unauthorized"),
        (stream_client.upgrade("/v1/envs/abc/stream/", token), 400, "unknown_instance"),
        (stream_client.upgrade(f"{path}?order=row", token), 400, "invalid_parameter"),
        (stream_client.upgrade(f"{path}?key=%20", token), 400, "invalid_parameter"),
    ):
        with socket.create_connection(("127.0.0.1", attacked.port), timeout=30) as connection:
            found, headers, body, _ = raw_http.answered(connection, request)
        assert (found, json.loads(body)["code"]) == (status, code)


def test_a_stop_of_the_server_ends_streams_after_their_answers(serve):
    server = serve()
    url = server.create("faulty_envs:Counting-v0", kwargs={"seconds": 1})
    with contextlib.closing(StreamClient(("127.0.0.1", server.port), url)) as stream:
        stream.reset()
        stream.socket.sendall(frame(stream.message(STEP, ARRAYS, bytes(4))))
        assert server.post("/v1/shutdown/")[0] == 200
        assert stream.answer()[1] == 200
        assert stream.closing()[0] == 1001
    server.process.wait(30)


def test_the_program_of_the_page_plays_an_episode(shared, capsys):
    pytest.importorskip("websockets")
    code = re.search(r"```python\n(.*?)```", PAGE, re.DOTALL)[1]
    exec(code.replace("127.0.0.1:5000", f"127.0.0.1:{shared.port}"), {})
    assert float(capsys.readouterr().out) > 5


@pytest.mark.slow
def test_a_message_that_was_cut_at_any_byte_is_done_once(shared, opened):
    stream = opened()
    stream.reset()
    stream.close()
    size = len(frame(stream.message(STEP, ARRAYS, bytes(4), number=0)))
    for after in range(size + 1):
        one = opened(stream.url)
        message = frame(one.message(STEP, ARRAYS, bytes(4), number=after + 2))
        one.socket.sendall(message[:after])
        if after % 2:
            one.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        one.close()
        # The answer to a whole message is lost, and the step is taken.
        again = opened(stream.url)
        arrays = again.arrays(again.step(0, number=after + 2)[2])
        assert arrays["observation"] == [after + 1]
        again.close()


@pytest.mark.slow
def test_any_bytes_are_answered_or_end_the_stream_and_the_instance_lives(opened):
    hypothesis = pytest.importorskip("hypothesis")
    from hypothesis import strategies as st

    first = opened()
    first.reset()
    usual = frame(first.message(STEP, ARRAYS, bytes(4), number=3))

    @st.composite
    def frames(draw):
        return mutated(draw, usual * draw(st.integers(1, 3)))

    @hypothesis.seed(1)
    @hypothesis.settings(max_examples=150, deadline=None, database=None)
    @hypothesis.given(frames())
    def check(sent):
        one = opened(first.url)
        one.socket.sendall(sent)
        one.socket.shutdown(socket.SHUT_WR)
        while True:
            try:
                opcode, _ = one.receive_frame()
            except ConnectionError:
                break
            assert opcode in (2, 8, 10)
        one.close()

    check()
    last = opened(first.url)
    assert last.ask(RESET, number=2**50)[1] == 200
