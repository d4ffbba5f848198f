"""The size of one error in the log and in a response."""

import logging

import pytest

from gym_server import logs
from gym_server.errors import answer_to, environment_error

LONG = "x" * 10**6


def fail(message, cause=LONG):
    raise RuntimeError(message) from ValueError(cause)


@pytest.fixture
def logged(monkeypatch):
    """Return a function that logs an error, and the resulting text."""
    formatter = logs.Formatter("%(levelname)s %(message)s")

    def logged(error, message="It failed"):
        info = (type(error), error, error.__traceback__)
        return formatter.format(logging.LogRecord("a", 30, "", 0, message, (), info))

    return logged


def caught(function, *arguments):
    with pytest.raises(Exception) as caught:
        function(*arguments)
    return caught.value


def test_a_long_message_is_cut_in_the_log_and_its_traceback_too(logged):
    text = logged(caught(fail, LONG), LONG)
    assert "in fail" in text and "direct cause" in text and "..." in text
    assert len(text) < 8000


def test_the_lines_of_a_long_message_are_cut_too(logged):
    assert len(logged(caught(fail, "x\n" * 10**6), "x\n" * 10**6)) < 8000


def test_a_long_traceback_is_cut(logged):
    def one(depth):
        return two(depth - 1) if depth else fail(LONG)

    def two(depth):
        return one(depth)

    assert len(logged(caught(one, 200))) < 25_000


def test_a_place_logs_one_traceback_a_minute(logged, monkeypatch):
    now = [0.0]
    monkeypatch.setattr(logs.time, "monotonic", lambda: now[0])
    first, second, elsewhere = (caught(fail, "a"), caught(fail, "b"), caught(lambda: 1 / 0))
    assert "in fail" in logged(first)
    now[0] = 59
    assert "Traceback" not in logged(second)
    assert "less than a minute ago" in logged(second)
    assert "Traceback" in logged(elsewhere)
    now[0] = 61
    assert "in fail" in logged(second)


def test_the_place_of_an_environments_error_is_in_the_environment(logged):
    def wrapped(function):
        try:
            function("a", "b")
        except RuntimeError as error:
            raise environment_error(error) from error

    def other(*_):
        raise RuntimeError("a")

    assert "in fail" in logged(caught(wrapped, fail))
    assert "in other" in logged(caught(wrapped, other))


def test_a_long_message_is_cut_in_what_is_answered():
    body = answer_to(environment_error(RuntimeError(LONG)))[1]
    assert body["message"].startswith("The environment raised RuntimeError: xxx")
    assert len(body["message"]) == 2000 and body["message"].endswith("...")


def test_a_warning_is_logged_once_a_minute(monkeypatch, caplog):
    now = [0.0]
    monkeypatch.setattr(logs.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(logs, "_warned", {})
    for at in (0, 59, 61):
        now[0] = at
        logs._show_warning("after the end", UserWarning, "env.py", 1)
    logs._show_warning("another", UserWarning, "env.py", 1)
    assert [record.args[-1] for record in caplog.records] == ["after the end"] * 2 + ["another"]
