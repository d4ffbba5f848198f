import pytest

from gym_server.cli.options import parser
from gym_server.manager.limits import Limits


def test_without_options_the_limits_are_those_of_a_lab():
    options = parser().parse_args([])
    for name, value in vars(Limits()).items():
        assert getattr(options, name, value) == value


def test_an_option_that_ended_says_what_replaces_it(capsys):
    for words in (["--no-shutdown"], ["--max-watchers", "5"], ["--own-log=x"]):
        with pytest.raises(SystemExit):
            parser().parse_args(words)
        assert f"{words[0].split('=')[0]} is gone: " in capsys.readouterr().err


def test_limits_of_time_may_be_parts_and_0():
    options = parser().parse_args(["--idle-minutes", "0.5", "--max-call-seconds", "0"])
    assert (options.idle_minutes, options.max_call_seconds) == (0.5, 0)


@pytest.mark.parametrize("value", ["-1", "soon", "inf", "nan"])
@pytest.mark.parametrize("name", ["--idle-minutes", "--max-call-seconds"])
def test_limits_of_time_are_numbers(name, value, capsys):
    with pytest.raises(SystemExit):
        parser().parse_args([f"{name}={value}"])
    assert f"'{value}' is not a number of at least 0" in capsys.readouterr().err


@pytest.mark.parametrize(
    "name",
    [
        "--max-processes",
        "--max-memory-mb",
    ],
)
def test_limits_of_numbers_are_at_least_1(name):
    with pytest.raises(SystemExit):
        parser().parse_args([name, "0"])
