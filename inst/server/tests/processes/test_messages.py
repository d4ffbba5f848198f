"""Messages from an environment's process are checked before use."""

import multiprocessing
import pickle
import threading

import numpy as np
import pytest

from gym_server.errors import GymServerError
from gym_server.processes.messages import (
    _HEAD,
    CallPipe,
    answer_message,
    object_message,
    refusal_message,
    value_message,
)
from gym_server.processes.pipe import ConnectionPipe, MalformedMessageError, Pipe
from gym_server.protocol.answers import Ready
from gym_server.protocol.safetensors import TENSORS
from gym_server.response import JSON


@pytest.fixture(params=[Pipe, ConnectionPipe])
def ends(request, monkeypatch):
    """Return a pipe for calls, and its other end."""
    monkeypatch.setattr("gym_server.processes.messages.Pipe", request.param)
    ours, theirs = multiprocessing.Pipe()
    pipe, other = CallPipe(ours), request.param(theirs)
    yield pipe, other
    pipe.wake()
    pipe.close()
    other.close()


def test_calls_and_results_arrive_as_they_were(ends):
    pipe, other = ends
    frame = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    answers = [Ready(b'{"a":1}', JSON), Ready(b"x" * 300_000, TENSORS, 7)]
    for message in (
        answer_message(1, answers[0]),
        answer_message(2, answers[1]),
        value_message(3, {"a": [1, "ä", None]}),
        value_message(4, None, frame),
    ):
        sender = threading.Thread(target=other.send, args=(message,))
        sender.start()
        answer = pipe.call("step", [1], {"b": 2})
        sender.join()
        number, method, args = pickle.loads(other.receive())
        assert (method, args) == ("step", ([1], {"b": 2}))
        if number < 3:
            assert answer == answers[number - 1]
    assert (answer.frame == frame).all()


def test_a_refusal_is_raised_with_all_its_words(ends):
    pipe, other = ends
    other.send(refusal_message(1, {"code": "reset_needed", "message": "m", "hint": "h"}))
    with pytest.raises(GymServerError) as caught:
        pipe.call("step")
    assert (caught.value.code, caught.value.message, caught.value.hint) == (
        "reset_needed",
        "m",
        "h",
    )


def test_a_result_that_came_too_late_is_ignored(ends):
    pipe, other = ends
    with pytest.raises(TimeoutError):
        pipe.call("about", timeout=0.01)
    other.send(value_message(1, "late"))
    other.send(value_message(2, "mine"))
    assert pipe.call("about", timeout=5).value == "mine"


FORGED = [
    b"",
    b"\x80\x05N.",
    pickle.dumps((1, print, ("run",))),
    _HEAD.pack(2, 1, 2) + b"[]",
    _HEAD.pack(0, 1, 2) + b"[]",
    _HEAD.pack(1, 9, 2) + b"[]",
    _HEAD.pack(1, 1, 2) + b"[]",
    _HEAD.pack(1, 1, 99) + b"[1,null]",
    _HEAD.pack(1, 1, 8) + b"[1,nulL]",
    _HEAD.pack(1, 1, 100_000) + b"[" * 100_000,
    _HEAD.pack(1, 0, 2) + b"[]",
    _HEAD.pack(1, 0, 18) + b'{"code":1,"hint":2}'[:18],
    _HEAD.pack(1, 0, 29) + b'{"code":"a b","message":"ok"}',
    _HEAD.pack(1, 1, 12) + b"[1, [2,2,3]]",
    _HEAD.pack(1, 1, 14) + b"[1, [9,9,9,9]]",
    _HEAD.pack(1, 1, 16) + b"[1, [true,1,1]]x",
    _HEAD.pack(1, 1, 13) + b"[1, [-1,1,1]]",
]


def test_a_result_is_read_after_the_process_has_ended():
    ours, theirs = multiprocessing.Pipe()
    pipe, other = CallPipe(ours), Pipe(theirs)
    pipe.begin("step")
    other.send(value_message(1, "made"))
    other.close()
    pipe.wake()
    assert pipe.finish().value == "made"
    pipe.close()
    with pytest.raises(OSError):
        pipe.call("step")


def test_objects_are_read_from_processes_that_are_trusted_only():
    for trusted in (True, False):
        ours, theirs = multiprocessing.Pipe()
        pipe, other = CallPipe(ours, trusted), Pipe(theirs)
        other.send(object_message(1, {1, 2}))
        if trusted:
            assert pipe.call("step") == {1, 2}
        else:
            with pytest.raises(MalformedMessageError):
                pipe.call("step")
        pipe.close()
        other.close()


@pytest.mark.parametrize("forged", FORGED)
def test_what_is_no_result_is_refused(ends, forged):
    pipe, other = ends
    other.send(forged)
    with pytest.raises(MalformedMessageError):
        pipe.call("step")


def test_nothing_is_allocated_on_the_word_of_a_length():
    ours, theirs = multiprocessing.Pipe()
    pipe = CallPipe(ours)
    theirs.send_bytes((2**62).to_bytes(8, "little")[4:])
    with pytest.raises((MalformedMessageError, OSError, EOFError)):
        theirs.close()
        pipe.call("step")
    pipe.close()
