import csv
import re
import sys
from pathlib import Path

import gymnasium
import numpy as np
import pytest

from gym_server.envs import wrappers
from gym_server.protocol.safetensors import TENSORS, read


def refusal(client, *chosen, env_id="CartPole-v1"):
    answer = client.post("/v1/envs/", json={"env_id": env_id, "wrappers": list(chosen)})
    assert answer.status_code == 400, answer.json
    assert client.get("/v1/envs/").json == {"all_envs": {}}
    return answer.json


def wrapped(name, **kwargs):
    return {"name": name, "kwargs": kwargs}


# Each wrapper of Gymnasium, with arguments and an environment that it fits.
EXAMPLES = [
    # An environment with small pictures.
    ("faulty_envs:Drawing-v0", wrapped("AddRenderObservation", render_only=False)),
    ("CartPole-v1", wrapped("AddWhiteNoise", probability_of_noise_per_pixel=0.5)),
    ("Pendulum-v1", wrapped("ClipAction")),
    ("CartPole-v1", wrapped("ClipReward", min_reward=-1, max_reward=0.5)),
    ("CartPole-v1", wrapped("DelayObservation", delay=2)),
    ("Pendulum-v1", wrapped("DiscretizeAction", bins=5)),
    ("Pendulum-v1", wrapped("DiscretizeObservation", bins=[3, 3, 3])),
    ("CartPole-v1", wrapped("DtypeObservation", dtype="float64")),
    ("CartPole-v1", wrapped("FlattenObservation")),
    ("CartPole-v1", wrapped("FrameStackObservation", stack_size=3.0)),
    ("CartPole-v1", wrapped("MaxAndSkipObservation", skip=2)),
    ("CartPole-v1", wrapped("NormalizeObservation", epsilon=1e-6)),
    ("CartPole-v1", wrapped("NormalizeReward", gamma=0.9)),
    (
        "CartPole-v1",
        wrapped("ObstructView", obstructed_pixels_ratio=0.5, obstruction_width=4),
    ),
    ("CartPole-v1", wrapped("RecordEpisodeStatistics")),
    ("CartPole-v1", wrapped("RepeatAction", num_repeats=2)),
    ("Pendulum-v1", wrapped("RescaleAction", min_action=-1, max_action=1)),
    ("Pendulum-v1", wrapped("RescaleAction", min_action=[-0.5], max_action=[1.0])),
    ("Pendulum-v1", wrapped("RescaleObservation", min_obs=[0, 0, -1], max_obs=1)),
    ("CartPole-v1", wrapped("ReshapeObservation", shape=[2, 2])),
    (
        "CartPole-v1",
        wrapped("StickyAction", repeat_action_probability=0.5, repeat_action_duration=[1, 2]),
    ),
    ("CartPole-v1", wrapped("TimeAwareObservation", normalize_time=True)),
    ("CartPole-v1", wrapped("TimeLimit", max_episode_steps=7)),
]
IN_OTHERS = {
    "AtariPreprocessing",
    "FilterObservation",
    "GrayscaleObservation",
    "ResizeObservation",
}


@pytest.mark.slow
@pytest.mark.parametrize(("env_id", "wrapper"), EXAMPLES)
def test_a_wrapped_environment_plays_and_draws(client, create, env_id, wrapper):
    if wrapper["name"] not in wrappers.allowed():
        pytest.skip("this Gymnasium has no such wrapper")
    url = create(env_id, seed=1, wrappers=[wrapper])
    assert client.get(url).json["wrappers"] == [wrapper]
    answer = client.post(f"{url}/reset/")
    assert answer.status_code == 200, answer.json
    action = client.get(f"{url}/action_space/sample").json["action"]
    answer = client.post(f"{url}/step/", json={"action": action}, headers={"Accept": TENSORS})
    assert answer.status_code == 200, answer.json
    assert client.get(f"{url}/render/").content_type == "image/png"
    claim = {"value": client.post(f"{url}/step/", json={"action": action}).json["observation"]}
    if wrapper["name"] != "NormalizeObservation":
        assert client.post(f"{url}/observation_space/contains", json=claim).json["member"]


def test_every_allowed_wrapper_is_tried():
    tried = {wrapper["name"] for _, wrapper in EXAMPLES}
    assert {name for name in wrappers.allowed() if name not in tried} == IN_OTHERS


@pytest.mark.parametrize(
    "name", ["RecordVideo", "HumanRendering", "TransformReward", "Autoreset", "vector", "X", ""]
)
def test_a_wrapper_that_is_not_on_the_list_is_refused_with_the_list(client, name):
    refused = refusal(client, wrapped("TimeLimit", max_episode_steps=3), wrapped(name))
    assert refused["code"] == "wrapper_not_allowed"
    assert f"'{name}'" in refused["message"]
    assert "TimeLimit" in refused["hint"]
    assert "AtariPreprocessing" in refused["hint"]


def test_nothing_is_made_for_a_wrapper_that_is_not_on_the_list(client):
    refused = refusal(client, wrapped("X"), env_id="faulty_envs:RaisesInConstructor-v0")
    assert refused["code"] == "wrapper_not_allowed"


def test_what_a_wrapper_does_not_know_is_refused_by_name(client):
    refused = refusal(client, wrapped("TimeLimit", steps=3))
    assert refused["code"] == "invalid_kwargs"
    assert refused["message"] == "TimeLimit: got an unexpected keyword argument 'steps'"
    assert "max_episode_steps" in refusal(client, wrapped("TimeLimit"))["message"]


def test_a_wrapper_that_does_not_fit_says_why(client):
    refused = refusal(client, wrapped("GrayscaleObservation"))
    assert refused["code"] == "invalid_kwargs"
    assert refused["message"].startswith("GrayscaleObservation cannot wrap this environment: ")
    ragged = wrapped("RescaleAction", min_action=[[0], [0, 0]], max_action=1)
    assert refusal(client, ragged, env_id="Pendulum-v1")["code"] == "invalid_kwargs"


@pytest.mark.parametrize(
    "value",
    ["TimeLimit", [1], [{}], [{"name": 1}], [{"name": "ClipAction", "kwargs": [1]}], {"a": 1}],
)
def test_what_is_no_list_of_wrappers_is_refused(client, value):
    answer = client.post("/v1/envs/", json={"env_id": "CartPole-v1", "wrappers": value})
    assert (answer.status_code, answer.json["code"]) == (400, "invalid_parameter")


def test_kwargs_may_be_left_out(client, create):
    about = client.get(create("Pendulum-v1", wrappers=[{"name": "ClipAction"}])).json
    assert about["action_space"]["high"] == [1e100]


def test_the_first_wrapper_is_the_innermost(client, create):
    stack, flatten = wrapped("FrameStackObservation", stack_size=3), wrapped("FlattenObservation")
    flat = client.get(create(wrappers=[stack, flatten])).json["observation_space"]
    stacked = client.get(create(wrappers=[flatten, stack])).json["observation_space"]
    assert (flat["shape"], stacked["shape"]) == ([12], [3, 4])


@pytest.mark.parametrize(
    ("wrapper", "wanted"),
    [
        (wrapped("DelayObservation", delay=1), [[0], [1]]),
        (wrapped("FrameStackObservation", stack_size=2), [[[0], [1]], [[1], [2]]]),
    ],
)
def test_observations_of_earlier_steps_are_not_changed_in_place(client, create, wrapper, wanted):
    url = create("faulty_envs:KeepsItsArrays-v0", wrappers=[wrapper])
    client.post(f"{url}/reset/")
    answers = [client.post(f"{url}/step/", json={"action": 0}).json for _ in range(2)]
    assert [answer["observation"] for answer in answers] == wanted


def test_a_time_limit_truncates_and_is_told(client, create):
    url = create(wrappers=[wrapped("TimeLimit", max_episode_steps=2)])
    assert client.get(url).json["max_episode_steps"] == 2
    client.post(f"{url}/reset/", json={"seed": 1})
    answers = [client.post(f"{url}/step/", json={"action": 0}).json for _ in range(2)]
    assert [answer["truncated"] for answer in answers] == [False, True]


@pytest.mark.parametrize(
    "how", [{}, *({"num_envs": 2, "vectorization_mode": mode} for mode in (None, "sync", "async"))]
)
def test_of_several_time_limits_the_smallest_is_told_which_is_what_is_played(client, create, how):
    def time_limit(**fields):
        return client.get(create("MountainCar-v0", **fields, **how)).json["max_episode_steps"]

    limits = [wrapped("TimeLimit", max_episode_steps=steps) for steps in (1000, 700)]
    assert time_limit(wrappers=limits) == 200
    assert time_limit(wrappers=[*limits, wrapped("FlattenObservation")]) == 200
    assert time_limit(wrappers=limits, kwargs={"max_episode_steps": 2000}) == 700
    assert time_limit(wrappers=limits, kwargs={"max_episode_steps": -1}) == 700
    assert time_limit(kwargs={"max_episode_steps": -1}) is None


def test_a_wrapped_episode_is_that_of_gymnasium(client, create):
    chosen = [
        wrapped("RescaleAction", min_action=-1, max_action=1),
        wrapped("NormalizeObservation"),
    ]
    url = create("Pendulum-v1", wrappers=chosen)
    env = gymnasium.wrappers.RescaleAction(gymnasium.make("Pendulum-v1"), -1, 1)
    env = gymnasium.wrappers.NormalizeObservation(env)
    expected, _ = env.reset(seed=3)
    answer = client.post(f"{url}/reset/", json={"seed": 3}, headers={"Accept": TENSORS})
    assert np.array_equal(read(answer.data).tensors["observation"].array(), expected)
    for action in (-1.0, 0.25, 1.0):
        expected, reward, *_ = env.step(np.array([action], np.float32))
        answer = client.post(f"{url}/step/", json={"action": action}, headers={"Accept": TENSORS})
        tensors = read(answer.data).tensors
        assert np.array_equal(tensors["observation"].array(), expected)
        assert tensors["reward"].array() == reward


def test_what_draws_in_each_step_does_so_on_the_render_thread(client, create):
    import faulty_envs

    chosen = [wrapped("AddRenderObservation")]
    faulty_envs.Drawing.threads.clear()
    url = create("faulty_envs:Drawing-v0", wrappers=chosen)
    assert client.get(url).json["observation_space"]["shape"] == [16, 32, 3]
    client.post(f"{url}/reset/")
    client.post(f"{url}/step/", json={"action": 0})
    client.get(f"{url}/render/")
    client.post(f"{url}/close/")
    assert len(faulty_envs.Drawing.threads) == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    "chosen",
    [
        [wrapped("FrameStackObservation", stack_size=2)],
        [wrapped("AddRenderObservation"), wrapped("ResizeObservation", shape=[40, 60])],
    ],
)
def test_a_wrapped_environment_is_monitored(client, create, monitor_dir, chosen):
    pytest.importorskip("moviepy")
    url = create(wrappers=[*chosen, wrapped("TimeLimit", max_episode_steps=3)])
    start = {"directory": "run", "video_callable": True}
    assert client.post(f"{url}/monitor/start/", json=start).status_code == 204
    client.post(f"{url}/reset/", json={"seed": 1})
    while not client.post(f"{url}/step/", json={"action": 0}).json["done"]:
        pass
    assert client.post(f"{url}/monitor/close/").status_code == 204
    with open(monitor_dir / "run" / "episodes.csv", newline="") as table:
        assert list(csv.reader(table))[1][:3] == ["0", "3.0", "3"]
    assert (monitor_dir / "run" / "rl-video-episode-0.mp4").stat().st_size > 0


def test_an_atari_frame_is_made_small_where_it_is_cheap(client, create):
    pytest.importorskip("ale_py")
    pytest.importorskip("cv2")
    chosen = [
        wrapped("AtariPreprocessing", screen_size=84),
        wrapped("FrameStackObservation", stack_size=4),
    ]
    url = create("ALE/Pong-v5", kwargs={"frameskip": 1}, wrappers=chosen)
    space = client.get(url).json["observation_space"]
    assert (space["shape"], space["dtype"]) == ([4, 84, 84], "uint8")
    answer = client.post(f"{url}/reset/", headers={"Accept": TENSORS})
    assert read(answer.data).tensors["observation"].shape == (4, 84, 84)


def test_pictures_are_made_grey_and_small(client, create):
    pytest.importorskip("cv2")
    chosen = [
        wrapped("AddRenderObservation", render_only=False),
        wrapped("FilterObservation", filter_keys=["pixels"]),
    ]
    about = client.get(create(wrappers=chosen)).json
    assert [part["key"] for part in about["observation_space"]["spaces"]] == ["pixels"]
    chosen = [
        wrapped("AddRenderObservation"),
        wrapped("GrayscaleObservation"),
        wrapped("ResizeObservation", shape=[40, 60.0]),
    ]
    assert client.get(create(wrappers=chosen)).json["observation_space"]["shape"] == [40, 60]


def test_a_wrapper_whose_library_is_missing_names_the_extra(client, monkeypatch):
    monkeypatch.setitem(sys.modules, "cv2", None)
    chosen = [wrapped("AddRenderObservation"), wrapped("ResizeObservation", shape=[8, 8])]
    refused = refusal(client, *chosen)
    assert refused["code"] == "missing_dependency"
    assert refused["message"] == "ResizeObservation needs the server's extra 'atari'"
    assert "opencv-python-headless" in refused["hint"]


def test_there_are_only_so_many_wrappers(client, create):
    one = wrapped("TimeLimit", max_episode_steps=9)
    refused = refusal(client, *[one] * 33)
    assert refused["code"] == "invalid_parameter"
    assert "at most 32, not 33" in refused["message"]
    create(wrappers=[one] * 32)


def test_a_non_finite_argument_is_a_number(client):
    chosen = wrapped("ClipReward", min_reward="-Infinity", max_reward=0.5)
    answer = client.post("/v1/envs/", json={"env_id": "CartPole-v1", "wrappers": [chosen]})
    assert answer.status_code == 200, answer.json
    instance = f"/v1/envs/{answer.json['instance_id']}"
    client.post(f"{instance}/reset/")
    assert client.post(f"{instance}/step/", json={"action": 1}).json["reward"] == 0.5


def test_the_page_on_gymnasium_lists_these_wrappers():
    page = Path(__file__).parents[4] / "vignettes" / "gymnasium.Rmd"
    if not page.exists():
        pytest.skip("the server is not in a checkout")
    text = page.read_text(encoding="utf-8")
    listed = text.partition("The server has")[2].partition("These are different")[0]
    assert sorted(re.findall(r"`(\w+)`", listed)) == sorted(wrappers.allowed())
