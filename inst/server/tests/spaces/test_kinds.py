import json

import numpy as np
import pytest
from gymnasium.spaces import Box, Dict, Discrete, MultiBinary, OneOf, Sequence, Tuple
from refusals import refused

from gym_server.spaces import NotInSpace, decode, describe, encode

PENDULUM = Box(-2.0, 2.0, (1,), np.float32)


def test_descriptions_are_json():
    for space in (Discrete(4), PENDULUM, Box(0, 1, (2, 2), bool)):
        json.dumps(describe(space), allow_nan=False)


def test_what_is_encoded_decodes_to_itself():
    for space in (Discrete(5, start=-2), PENDULUM, Box(0, 255, (2, 2), np.uint8)):
        space.seed(0)
        for _ in range(20):
            member = space.sample()
            wire = json.loads(json.dumps(encode(space, member)))
            assert np.array_equal(decode(space, wire), member)


def test_a_refusal_names_space_and_value_briefly():
    with pytest.raises(NotInSpace, match=r'^"left" is not in Discrete\(2\)$'):
        decode(Discrete(2), "left")
    with pytest.raises(NotInSpace) as refusal:
        decode(Box(np.arange(500.0), np.arange(500.0), dtype=np.float64), [1.5] * 1000)
    assert len(str(refusal.value)) < 250


@pytest.mark.parametrize(
    ("key", "path"),
    [
        ("position", "$position[2]"),
        (".x_1.y", "$.x_1.y[2]"),
        ("a/b", "$`a/b`[2]"),
        ("", "$``[2]"),
        ("1st", "$`1st`[2]"),
    ],
)
def test_a_refusal_names_the_path_as_r_writes_it(key, path):
    words = refused(Dict({key: Box(-1, 1, (3,))}), {key: [0, 0, "x"]})
    assert words == f'"x" at {path} is not in Box(-1.0, 1.0, (3,), float32)'


def test_a_path_leads_through_every_kind_of_nesting():
    space = Dict(a=Tuple([Discrete(2), Sequence(OneOf([Discrete(2), Dict(b=MultiBinary(2))]))]))
    value = {"a": [0, [[0, 1], [1, {"b": [1, 2]}]]]}
    assert refused(space, value) == "2 at $a[1][1][1]$b[1] is not in MultiBinary(2)"
