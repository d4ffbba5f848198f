import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete, MultiBinary, MultiDiscrete
from random_spaces import random_member, random_space, same

from gym_server import spaces
from gym_server.json_values import plain
from gym_server.protocol.safetensors import Tensor
from gym_server.spaces import NotInSpace, Parts
from gym_server.spaces.stacking import stack


def are_readable(space, members):
    """Return whether a sample is a member, which it is not if bounds are NaN."""
    try:
        for member in members:
            spaces.decode(space, plain(spaces.encode(space, member)))
    except NotInSpace:
        return False
    return True


@pytest.mark.parametrize("seed", range(150))
def test_sub_envs_survive_json(seed):
    rng = np.random.default_rng(seed)
    space = random_space(rng)
    members = [random_member(rng, space) for _ in range(3)]
    if not are_readable(space, members):
        return
    sent = [plain(spaces.encode(space, member)) for member in members]
    batch = spaces.decode_sub_envs(space, sent, spaces.Rows(3, "the 3 sub-environments"))
    one_by_one = stack(space, [spaces.decode(space, value) for value in sent])
    assert same(batch, one_by_one)


@pytest.mark.parametrize("seed", range(150))
def test_sub_envs_survive_tensors(seed):
    rng = np.random.default_rng(seed)
    space = random_space(rng, tensors=True)
    members = [random_member(rng, space) for _ in range(3)]
    if not are_readable(space, members):
        return
    batch = stack(space, members)
    parts = spaces.tensor_writer(space, "action", is_batch=True)(batch)
    back = spaces.tensor_reader(space, "action")(parts, spaces.Rows(3, "the 3 sub-environments"))
    assert same(back, batch)


def test_every_way_to_write_a_sub_env_is_read():
    box = Box(-1, 1, (1,), np.float32)
    assert spaces.decode_sub_envs(box, [[1], 0.5], spaces.Rows(2, "")).tolist() == [[1], [0.5]]
    assert spaces.decode_sub_envs(box, [1, 0.5], spaces.Rows(2, "")).tolist() == [[1], [0.5]]
    square = Box(0, 9, (2, 2), np.uint8)
    assert spaces.decode_sub_envs(
        square, [[1, 2, 3, 4], [[5, 6], [7, 8]]], spaces.Rows(2, "")
    ).tolist() == [
        [[1, 2], [3, 4]],
        [[5, 6], [7, 8]],
    ]
    assert spaces.decode_sub_envs(Discrete(3), [1, 2.0], spaces.Rows(2, "")).tolist() == [1, 2]
    assert spaces.decode_sub_envs(
        MultiBinary(2), [[True, 0], [1, 1]], spaces.Rows(2, "")
    ).tolist() == [
        [1, 0],
        [1, 1],
    ]


@pytest.mark.parametrize("dtype", [np.int32, np.int64])
@pytest.mark.parametrize(("sent", "rows"), [(2, None), ([0, 2], 2)])
def test_discrete_actions_may_be_32_or_64_bits_wide(dtype, sent, rows):
    parts = Parts({"action": Tensor.of(np.array(sent, dtype))})
    read = spaces.tensor_reader(Discrete(3, dtype=np.int8), "action")(parts, spaces.Rows(rows, ""))
    assert (read.dtype, read.tolist()) == (np.int8, sent)


@pytest.mark.parametrize(
    ("space", "dtype"),
    [
        (Discrete(3, start=-1), "I32"),
        (Discrete(3, dtype=np.uint64), "I32"),
        (Discrete(2, start=2**31 - 2), "I32"),
        (Discrete(2, start=2**31 - 1), "I64"),
        (Discrete(2, start=1 - 2**31), "I32"),
        # R's smallest integer is NA.
        (Discrete(2, start=-(2**31)), "I64"),
        (MultiDiscrete([3, 3]), "I64"),
    ],
)
def test_short_tensors_of_discrete_actions_are_integers_of_r(space, dtype):
    assert spaces.tensor_shapes(space, "action", short=True)["action"][0] == dtype


@pytest.mark.parametrize("action", [-1, 3])
@pytest.mark.parametrize("rows", [None, 1, 2])
def test_actions_out_of_bounds_are_refused_however_many_they_are(action, rows):
    array = np.array(action) if rows is None else np.array([0, action])[-rows:]
    read = spaces.tensor_reader(Discrete(3), "action")
    with pytest.raises(NotInSpace, match=f"^{action} "):
        read(Parts({"action": Tensor.of(array)}), spaces.Rows(rows, ""))


def test_unsigned_discrete_sub_envs_are_unsigned():
    space = Discrete(3, dtype=np.uint64)
    parts = spaces.tensor_writer(space, "action", is_batch=True)(np.array([0, 2], np.uint64))
    assert parts.tensors["action"].dtype == "U64"
    assert spaces.tensor_reader(space, "action")(parts, spaces.Rows(2, "")).dtype == np.uint64
    short = Parts({"action": Tensor.of(np.array([0, 2], np.int32))})
    assert spaces.tensor_reader(space, "action")(short, spaces.Rows(2, "")).dtype == np.uint64


@pytest.mark.parametrize("order", ["C", "F"])
def test_arrays_travel_with_the_last_index_fastest_however_they_lie(order):
    batch = np.arange(12, dtype=np.float32).reshape(3, 4).copy(order=order)
    tensor = spaces.tensor_writer(Box(0, 20, (4,)), "o", is_batch=True)(batch).tensors["o"]
    assert np.frombuffer(tensor.data, np.float32).tolist() == list(range(12))


def test_what_was_encoded_does_not_change_with_the_batch():
    batch = np.zeros((2, 3), np.float32)
    parts = spaces.tensor_writer(Box(0, 1, (3,)), "o", is_batch=True)(batch)
    batch[:] = 7
    assert parts.tensors["o"].array().tolist() == np.zeros((2, 3)).tolist()


def test_a_part_too_many_or_too_few_is_refused():
    parts = Parts({"action": Tensor.of(np.zeros(2, np.int64)), "action/x": Tensor.of(np.zeros(2))})
    with pytest.raises(NotInSpace, match="no such part"):
        spaces.tensor_reader(Discrete(3), "action")(parts, spaces.Rows(2, ""))
    with pytest.raises(NotInSpace, match="there is no tensor 'action'"):
        spaces.tensor_reader(Discrete(3), "action")(Parts(), spaces.Rows(2, ""))
