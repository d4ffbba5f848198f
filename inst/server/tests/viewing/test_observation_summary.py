import gymnasium
import numpy as np
import pytest
from faulty_envs import SPACES
from gymnasium.vector.utils import batch_space, create_empty_array

from gym_server.protocol.answers import dumps
from gym_server.spaces.stacking import stack, unstack
from gym_server.viewing.observation_summary import entries


def test_an_array_is_its_numbers_in_order():
    seen = entries(np.array([[1.5, 2.0], [3.0, 4.0]], dtype=np.float32))
    assert seen == {
        "names": ["[0]", "[1]", "[2]", "[3]"],
        "values": [1.5, 2.0, 3.0, 4.0],
        "size": 4,
    }


def test_a_single_value_needs_no_name():
    assert entries(np.int64(7)) == {"names": [""], "values": [7], "size": 1}
    assert entries("left")["values"] == ["left"]


def test_parts_are_named_by_their_place():
    observation = {"camera": {"zoom": np.float32(2), "at": np.zeros(2)}, "words": ("a", 3)}
    assert entries(observation)["names"] == [
        "camera.zoom",
        "camera.at[0]",
        "camera.at[1]",
        "words[0]",
        "words[1]",
    ]


def test_of_many_the_first_are_shown_and_all_are_counted():
    seen = entries((np.zeros((210, 160, 3), dtype=np.uint8), np.ones(5)))
    assert len(seen["names"]) == len(seen["values"]) == 64
    assert seen["size"] == 210 * 160 * 3 + 5


def test_a_long_text_is_cut():
    assert len(entries("x" * 5000)["values"][0]) == 200


@pytest.mark.parametrize("kind", SPACES)
def test_an_observation_of_any_space_can_be_looked_at(kind):
    space = SPACES[kind]
    space.seed(3)
    for _ in range(5):
        seen = entries(space.sample())
        assert len(seen["names"]) == len(seen["values"])
        assert dumps(seen)


@pytest.mark.parametrize("kind", [name for name in SPACES if name != "nothing"])
def test_a_sub_env_is_taken_out_of_a_batch(kind):
    space = SPACES[kind]
    space.seed(4)
    members = [space.sample() for _ in range(3)]
    batch = stack(space, members)
    assert list(map(entries, unstack(space, batch))) == list(map(entries, members))


def test_what_gymnasium_batches_can_be_taken_apart():
    space = gymnasium.spaces.Dict({"a": gymnasium.spaces.Box(0, 1, (2,))})
    batch = create_empty_array(batch_space(space, 2).spaces["a"], n=2)
    assert unstack(space, {"a": batch})[1]["a"].shape == batch[1].shape
