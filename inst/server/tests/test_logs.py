"""Warnings in the log, and the size of one error in a response."""

from gym_server import logs
from gym_server.errors import answer_to, environment_error


def test_a_long_message_is_cut_in_what_is_answered():
    body = answer_to(environment_error(RuntimeError("x" * 10**6)))[1]
    assert body["message"].startswith("The environment raised RuntimeError: xxx")
    assert len(body["message"]) == 2000 and body["message"].endswith("...")


def test_a_warning_is_logged_once(caplog):
    for text in ("after the end", "after the end", "another"):
        logs._show_warning(text, UserWarning, "env.py", 1)
    said = [record.getMessage() for record in caplog.records]
    assert said == ["env.py:1: UserWarning: after the end", "env.py:1: UserWarning: another"]
