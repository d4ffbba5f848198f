"""Which environments get their own process."""

import faulty_envs  # noqa: F401 - it registers what is asked for here
import pytest

from gym_server.isolation.policy import MODES, Isolation

ALLOWED = ["faulty_envs"]


@pytest.mark.parametrize(
    ("env_id", "allowed", "wanting"),
    [
        ("CartPole-v1", ALLOWED, ["all"]),
        ("CartPole", ALLOWED, ["all"]),
        ("gymnasium.envs.classic_control:CartPole-v1", ["gymnasium.envs.classic_control"], ["all"]),
        ("faulty_envs:Counting-v0", ALLOWED, ["foreign", "all"]),
        ("Counting-v0", ALLOWED, ["foreign", "all"]),
        # An allowed module may register it.
        ("Nobody-v0", ALLOWED, ["foreign", "all"]),
        ("Nobody-v0", [], ["all"]),
        # Refused without a process.
        ("os:Counting-v0", ALLOWED, []),
        (7, ALLOWED, []),
        ("x" * 201 + "-v0", ALLOWED, []),
    ],
)
def test_gymnasiums_own_are_not_foreign(env_id, allowed, wanting):
    assert [mode for mode in MODES if Isolation(mode).wants(env_id, allowed)] == wanting


def test_only_an_id_that_nobody_knows_imports_all_modules():
    isolation = Isolation("all", 100)
    for env_id, imported in [
        ("CartPole-v1", set()),
        ("faulty_envs:Counting-v0", set()),
        ("Nobody-v0", set(ALLOWED)),
    ]:
        settings = isolation.settings(env_id, ALLOWED, 5)
        assert (settings.imported, settings.max_num_envs, settings.max_mb) == (imported, 5, 100)


def test_ataris_own_vector_environment_is_made_elsewhere():
    pytest.importorskip("ale_py")
    pong = ("ALE/Pong-v5", ALLOWED)
    wanting = [mode for mode in MODES if Isolation(mode).wants(*pong, "vector_entry_point")]
    assert wanting == ["foreign", "all"]
    assert not Isolation("foreign").wants(*pong, "sync")
    assert not Isolation("foreign").wants("CartPole-v1", ALLOWED, "vector_entry_point")
