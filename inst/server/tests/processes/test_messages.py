"""What the process of an environment says is looked at before it is believed."""

import multiprocessing
import pickle
import threading

import numpy as np
import pytest

from gym_server.errors import GymServerError
from gym_server.processes.messages import _HEAD, Channel, answer_of, refusal_of, value_of
from gym_server.processes.pipe import ConnectionPipe, Nonsense, Pipe
from gym_server.protocol.answers import JSON, Answer
from gym_server.protocol.safetensors import TENSORS


@pytest.fixture(params=[Pipe, ConnectionPipe])
def ends(request, monkeypatch):
    """Return a channel and the pipe at its other end."""
    monkeypatch.setattr("gym_server.processes.messages.Pipe", request.param)
    ours, theirs = multiprocessing.Pipe()
    channel, other = Channel(ours), request.param(theirs)
    yield channel, other
    channel.wake()
    channel.close()
    other.close()


def test_questions_and_answers_arrive_as_they_were(ends):
    channel, other = ends
    frame = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    long = Answer(200, b"x" * 300_000, TENSORS)
    for message in (
        answer_of(1, Answer(200, b'{"a":1}')),
        answer_of(2, long),
        value_of(3, {"a": [1, "ä", None]}),
        value_of(4, None, frame),
    ):
        sender = threading.Thread(target=other.send, args=(message,))
        sender.start()
        answer = channel.ask("step", [1], {"b": 2})
        sender.join()
        number, method, args = pickle.loads(other.receive())
        assert (method, args) == ("step", ([1], {"b": 2}))
        if number < 3:
            assert answer == ((b'{"a":1}', JSON), (long.body, TENSORS))[number - 1]
    assert (answer.frame == frame).all()


def test_a_refusal_is_raised_with_all_its_words(ends):
    channel, other = ends
    other.send(refusal_of(1, {"code": "reset_needed", "message": "m", "hint": "h"}))
    with pytest.raises(GymServerError) as caught:
        channel.ask("step")
    assert (caught.value.code, caught.value.message, caught.value.hint) == (
        "reset_needed",
        "m",
        "h",
    )


def test_an_answer_that_came_too_late_is_nobodys(ends):
    channel, other = ends
    with pytest.raises(TimeoutError):
        channel.ask("about", seconds=0.01)
    other.send(value_of(1, "late"))
    other.send(value_of(2, "mine"))
    assert channel.ask("about", seconds=5).value == "mine"


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


@pytest.mark.parametrize("forged", FORGED)
def test_what_is_no_answer_is_refused(ends, forged):
    channel, other = ends
    other.send(forged)
    with pytest.raises(Nonsense):
        channel.ask("step")


def test_nothing_is_allocated_on_the_word_of_a_length():
    ours, theirs = multiprocessing.Pipe()
    channel = Channel(ours)
    theirs.send_bytes((2**62).to_bytes(8, "little")[4:])
    with pytest.raises((Nonsense, OSError, EOFError)):
        theirs.close()
        channel.ask("step")
    channel.close()
