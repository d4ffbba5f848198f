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


def test_the_error_of_an_environment_is_logged_once_with_its_traceback(caplog):
    def fail():
        raise RuntimeError("out of paint")

    for _ in range(2):
        try:
            fail()
        except RuntimeError as error:
            refusal = environment_error(error)
            refusal.__cause__ = error
        answer_to(refusal)
    (record,) = caplog.records
    assert record.message.startswith("The environment raised RuntimeError: out of paint\nTraceback")
    assert "in fail" in record.message
