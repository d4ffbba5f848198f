"""2,500 random members of 500 random spaces, as JSON, and 2,500 more as tensors."""

import json

import numpy as np
import pytest
import safetensors.numpy
from random_spaces import random_member, random_space, same

from gym_server import spaces
from gym_server.protocol.answers import dumps
from gym_server.protocol.safetensors import read, write
from gym_server.spaces import Parts, arrays

SPACES, MEMBERS = 25, 5


@pytest.fixture(autouse=True)
def not_a_number_is_a_member(monkeypatch):
    # NaN is not a member for Gymnasium, but environments observe it, so it must be sent unchanged.
    monkeypatch.setattr(arrays.Bounds, "hold", lambda bounds, array: True)


def pairs(seed, **how):
    rng = np.random.default_rng(seed)
    for _ in range(SPACES):
        space = random_space(rng, **how)
        json.dumps(spaces.describe(space), allow_nan=False)
        for _ in range(MEMBERS):
            yield space, random_member(rng, space)


@pytest.mark.parametrize("seed", range(20))
def test_a_member_comes_back_through_json_as_it_was(seed):
    for space, member in pairs(seed):
        sent = json.loads(dumps({"value": spaces.encode(space, member)}))["value"]
        back = spaces.decode(space, sent)
        assert same(member, back), (space, member, back)


@pytest.mark.parametrize("seed", range(20))
def test_a_member_comes_back_through_tensors_as_it_was(seed):
    for space, member in pairs(seed, tensors=True):
        assert spaces.travels_as_tensors(space)
        parts = spaces.tensor_writer(space, "action", is_batch=False)(member)
        raw = write(parts.tensors, {"texts": json.dumps(parts.texts)})
        file = read(raw)
        sent = Parts(file.tensors, json.loads(file.metadata["texts"]))
        back = spaces.tensor_reader(space, "action")(sent)
        assert same(member, back), (space, member, back)
        # Another reader gives the same result.
        published = safetensors.numpy.load(raw)
        assert published.keys() == file.tensors.keys()
        for name, array in published.items():
            assert same(array, file.tensors[name].array())


def test_the_random_spaces_are_of_every_kind():
    rng = np.random.default_rng(0)
    kinds, seen = set(), []
    for _ in range(500):
        space = random_space(rng)
        kinds |= {part["name"] for part in _parts(spaces.describe(space))}
        seen.append(json.dumps(spaces.encode(space, random_member(rng, space))))
    assert len(kinds) == 10
    for special in ("NaN", "Infinity", "-Infinity", "9007199254740993", "-2147483648", "[]"):
        assert any(special in text for text in seen), special


def _parts(description):
    if isinstance(description, dict):
        if "name" in description:
            yield description
        for value in description.values():
            yield from _parts(value)
    elif isinstance(description, list):
        for value in description:
            yield from _parts(value)
