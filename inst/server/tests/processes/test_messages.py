"""Calls to a process, and their results."""

import multiprocessing
import pickle
import threading

import numpy as np
import pytest

from gym_server.errors import GymServerError
from gym_server.processes.messages import CallPipe, result_message
from gym_server.processes.pipe import ConnectionPipe, Pipe


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


def call(pipe, method, *args):
    pipe.begin(method, *args)
    return pipe.finish()


def test_calls_and_results_arrive_as_they_were(ends):
    pipe, other = ends
    frame = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    for result in (b"x" * 300_000, {"a": [1, "ä", None]}, frame):
        sender = threading.Thread(target=other.send, args=(result_message(result),))
        sender.start()
        answer = call(pipe, "step", [1], {"b": 2})
        sender.join()
        assert pickle.loads(other.receive()) == ("step", ([1], {"b": 2}))
        np.testing.assert_equal(answer, result)


def test_a_refusal_is_raised_with_all_its_words(ends):
    pipe, other = ends
    other.send(result_message(None, GymServerError("reset_needed", "m", "h", "extra")))
    with pytest.raises(GymServerError) as caught:
        call(pipe, "step")
    error = caught.value
    assert (error.code, error.message, error.hint) == ("reset_needed", "m", "h")
    assert error.extra == "extra" and error.is_logged


def test_a_result_is_read_after_the_process_has_ended():
    ours, theirs = multiprocessing.Pipe()
    pipe, other = CallPipe(ours), Pipe(theirs)
    pipe.begin("step")
    other.send(result_message("made"))
    other.close()
    pipe.wake()
    assert pipe.finish() == "made"
    pipe.close()
    with pytest.raises(OSError):
        pipe.begin("step")


def test_a_result_that_cannot_be_read_is_an_error_of_the_call(ends):
    pipe, other = ends
    other.send(b"no pickle")
    with pytest.raises(GymServerError, match="Reading what the environment returned"):
        call(pipe, "step")
