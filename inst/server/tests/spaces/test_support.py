import numpy as np
import pytest
from gymnasium.spaces import Box, Dict, Discrete, Graph, OneOf, Sequence, Space, Text, Tuple

from gym_server.errors import GymServerError
from gym_server.protocol.answers import dumps
from gym_server.protocol.bodies import loads
from gym_server.spaces import decode, describe, encode
from gym_server.spaces.support import DEEPEST

LONG = Box(0, 1, (1,), np.longdouble)


class OwnSpace(Space):
    def __repr__(self):
        return "OwnSpace()"


class Narrow(Box):
    """A Box by another name."""


def refusal(space):
    with pytest.raises(GymServerError) as refused:
        describe(space)
    assert refused.value.code == "unsupported_space"
    return refused.value


@pytest.mark.parametrize(
    "space",
    [
        OwnSpace(),
        Tuple([OwnSpace()]),
        Dict(a=Tuple([OwnSpace()])),
        Sequence(OwnSpace()),
        OneOf([Discrete(2), OwnSpace()]),
    ],
)
def test_a_custom_space_is_refused_by_its_name_wherever_it_lies(space):
    refused = refusal(space)
    assert "spaces of type OwnSpace are not supported" in refused.message
    assert refused.hint == (
        "supported are Box, Dict, Discrete, Graph, MultiBinary, MultiDiscrete, OneOf, Sequence, "
        "Text, Tuple"
    )


@pytest.mark.parametrize(
    "space", [LONG, Dict(a=LONG), Tuple([LONG]), Sequence(LONG), OneOf([LONG]), Graph(LONG, None)]
)
@pytest.mark.skipif(np.dtype(np.longdouble).itemsize <= 8, reason="long doubles are doubles here")
def test_a_longdouble_is_refused_wherever_it_lies(space):
    assert "more digits than can be sent" in refusal(space).message


def test_a_kind_that_behaves_as_its_parent_is_its_parent():
    space = Narrow(0, 1, (2,), np.float32)
    assert describe(space)["name"] == "Box"
    assert decode(space, encode(space, space.sample())).shape == (2,)


def test_a_space_that_contains_itself_is_refused():
    space = Dict(a=Discrete(2))
    space["itself"] = space
    assert "nested deeper" in refusal(space).message


def _nested(levels):
    space = Discrete(2)
    for level in range(levels):
        space = Tuple([space]) if level % 2 else Dict(a=space)
    return space


def test_what_can_be_described_can_travel():
    space = _nested(DEEPEST)
    member = space.sample()
    described = describe(space)
    assert loads(dumps({"info": described}))["info"] == described
    answer = {"observation": encode(space, member), "nan": float("nan")}
    assert decode(space, loads(dumps(answer))["observation"]) == member
    assert "nested deeper" in refusal(_nested(DEEPEST + 1)).message


def test_two_keys_that_are_the_same_as_text_are_refused():
    assert "same as text" in refusal(Dict([(1, Discrete(2)), ("1", Discrete(2))])).message
    assert describe(Dict([(1, Discrete(2))]))["spaces"][0]["key"] == "1"


def test_a_description_has_all_that_the_constructor_needs():
    space = Dict(
        [
            ("z", Text(5, min_length=2, charset="ba")),
            ("a", Graph(Box(0, 1, (1,)), Discrete(3))),
            ("s", Sequence(Discrete(2), stack=True)),
        ]
    )
    box = {"name": "Box", "dtype": "float32", "shape": [1], "low": [0.0], "high": [1.0]}
    text = {"name": "Text", "dtype": None, "min_length": 2, "max_length": 5, "characters": "ab"}
    two, three = ({"name": "Discrete", "dtype": "int64", "n": n, "start": 0} for n in (2, 3))
    graph = {"name": "Graph", "dtype": None, "node_space": box, "edge_space": three}
    sequence = {"name": "Sequence", "dtype": None, "space": two, "stack": True}
    assert describe(space) == {
        "name": "Dict",
        "dtype": None,
        "spaces": [
            {"key": "z", "space": text},
            {"key": "a", "space": graph},
            {"key": "s", "space": sequence},
        ],
    }
