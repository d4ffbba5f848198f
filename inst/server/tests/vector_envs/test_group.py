import faulty_envs  # noqa: F401 - it registers what is made here
import gymnasium
import pytest
from gymnasium.vector import AutoresetMode

from gym_server.errors import GymServerError
from gym_server.rendering.render_thread import RenderThread
from gym_server.vector_envs.group import Group
from gym_server.vector_envs.sub_env import SubEnv


def group_of(env_id, numbers, mode):
    sub_env = SubEnv(gymnasium.spec(env_id), None, {}, (), RenderThread())
    return Group(sub_env, numbers, mode)


@pytest.fixture
def group():
    group = group_of("CartPole-v1", [4, 5, 6], AutoresetMode.NEXT_STEP)
    group.reset([0, 1, 2], [1, 2, 3], [None] * 3, None)
    yield group
    group.close()


def fails_after(count):
    yield from [0] * count
    raise RuntimeError("no more actions")


@pytest.mark.parametrize(
    ("actions", "wanted"),
    [(fails_after(1), "no more actions"), ([0, 0], "2 actions"), ([0] * 4, "4 actions")],
)
def test_actions_that_do_not_come_are_no_failure_of_a_sub_environment(group, actions, wanted):
    with pytest.raises(Exception, match=wanted) as failure:
        group.step(None, actions, True)
    assert "Sub-environment" not in str(failure.value)


def test_a_failure_names_the_sub_environment_whose_action_it_was(group):
    with pytest.raises(GymServerError, match="Sub-environment 5 raised"):
        group.step(None, [0, 7, 0], True)


def test_each_sub_environment_has_options_of_its_own():
    group = group_of("Counting-v0", [0, 1], AutoresetMode.NEXT_STEP)
    _, infos = group.reset([0, 1], [1, 2], [None] * 2, {"starts": [1]})
    infos[0][0]["options"]["starts"].clear()
    assert infos[1][0]["options"] == {"starts": [1]}


def test_what_an_episode_ended_with_stays_when_the_next_one_changes_it_in_place():
    group = group_of("KeepsItsArrays-v0", [0, 1], AutoresetMode.SAME_STEP)
    group.reset([0, 1], [1, 2], [None] * 2, None)
    for _ in range(3):
        outcome = group.step(None, [0, 0], True)
    assert outcome.observation.tolist() == [[0], [0]]
    assert outcome.final == {0: [3], 1: [3]}
    assert [final for _, final in outcome.infos] == [{"steps": 3, "nested": {"list": [3]}}] * 2


def test_an_info_that_holds_itself_ends_an_episode():
    group = group_of("KeepsItsArrays-v0", [0], AutoresetMode.SAME_STEP)
    _, [(info, _)] = group.reset([0], [1], [None], None)
    info["itself"] = info
    for _ in range(3):
        outcome = group.step(None, [0], True)
    assert outcome.infos[0][1]["itself"]["steps"] == [3]
