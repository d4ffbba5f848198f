from collections.abc import Sequence

import pytest

from gym_server.envs.tuple_arguments import with_tuples

pytestmark = pytest.mark.slow


class Takes:
    def __init__(
        self,
        skip: "tuple[int, int] | int" = 4,
        start=(0, 0),
        grid: tuple[tuple[int, ...], ...] | None = None,
        desc: list[str] | tuple[str, ...] | None = None,
        hidden: Sequence[int] = (1, 2),
        either: Sequence[int] | tuple[int, int] | None = None,
        anything=None,
    ): ...


@pytest.mark.parametrize(
    ("name", "given", "wanted"),
    [
        ("skip", [2, 5], (2, 5)),
        ("skip", 3, 3),
        ("start", [1, 2], (1, 2)),
        ("grid", [[1], [2, 3]], ((1,), (2, 3))),
        ("desc", ["SF", "FG"], ["SF", "FG"]),
        ("hidden", [3, 4], (3, 4)),
        ("either", [3, 4], [3, 4]),
        ("anything", [3, 4], [3, 4]),
        ("unknown", [3, 4], [3, 4]),
    ],
)
def test_lists_become_tuples_where_the_constructor_asks_for_tuples(name, given, wanted):
    assert with_tuples(Takes, {name: given, "other": 1}) == {name: wanted, "other": 1}


def test_annotations_that_cannot_be_evaluated_are_read():
    def create(skip: "Unknown | tuple", start: "Unknown" = (0, 0)): ...  # noqa: F821

    assert with_tuples(create, {"skip": [1], "start": [1]}) == {"skip": (1,), "start": (1,)}
    assert with_tuples(type(None), {"skip": [1]}) == {"skip": [1]}


@pytest.mark.parametrize("num_envs", [None, 2])
def test_a_range_of_frames_reaches_an_atari_game(client, create, num_envs):
    pytest.importorskip("ale_py")
    url = create("ALE/Pong-v5", kwargs={"frameskip": [2, 5]}, num_envs=num_envs)
    assert client.post(f"{url}/reset/").status_code == 200
    answer = client.post(f"{url}/step/", json={"action": 0 if num_envs is None else [0, 0]})
    frames = answer.json["info"]["episode_frame_number"]
    assert all(2 <= n <= 5 for n in (frames if num_envs else [frames]))
