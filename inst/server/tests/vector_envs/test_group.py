import gymnasium
import pytest
from gymnasium.vector import AutoresetMode

from gym_server.envs.memory_reservation import MemoryReservation
from gym_server.errors import GymServerError
from gym_server.rendering.render_thread import RenderThread
from gym_server.vector_envs.group import Group
from gym_server.vector_envs.sub_env import SubEnv


@pytest.fixture
def group():
    spec = gymnasium.spec("CartPole-v1")
    sub_env = SubEnv(spec, None, {}, (), RenderThread(), MemoryReservation())
    group = Group(sub_env, [4, 5, 6], AutoresetMode.NEXT_STEP)
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
