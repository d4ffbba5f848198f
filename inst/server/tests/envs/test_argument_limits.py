"""Limits on the steps of one call, and on the size of arguments."""

import pytest

pytestmark = pytest.mark.slow


@pytest.fixture
def refused(client):
    """Create an environment that must be refused; return the message."""

    def refused(env_id="CartPole-v1", **fields):
        answer = client.post("/v1/envs/", json={"env_id": env_id, **fields})
        assert (answer.status_code, answer.json["code"]) == (400, "invalid_kwargs"), answer.json
        return answer.json["message"]

    return refused


def repeating(*numbers):
    return [{"name": "RepeatAction", "kwargs": {"num_repeats": number}} for number in numbers]


@pytest.mark.parametrize(
    "wrappers",
    [
        repeating(10**15),
        repeating(10**15, 10**15),
        repeating(100, 11),
        repeating("Infinity"),
        [{"name": "MaxAndSkipObservation", "kwargs": {"skip": 10**15}}],
        [{"name": "MaxAndSkipObservation", "kwargs": {"skip": 40}}, *repeating(40)],
        [{"name": "TimeLimit", "kwargs": {"max_episode_steps": 10**15}}, *repeating(1001)],
    ],
)
@pytest.mark.parametrize("num_envs", [None, 2])
def test_a_step_repeats_only_so_often(refused, wrappers, num_envs):
    message = refused(wrappers=wrappers, num_envs=num_envs, kwargs={"max_episode_steps": 10**15})
    assert "One call would take" in message


def test_repeats_count_for_each_sub_environment(refused, create):
    assert "1,024,000 steps, by num_repeats 1000 and 1024" in refused(
        wrappers=repeating(1000), num_envs=1024
    )
    create(wrappers=repeating(4), num_envs=1024)


def test_honest_repeats_are_taken(create, client):
    url = create(wrappers=repeating(10, 100), kwargs={"max_episode_steps": 10**15})
    client.post(f"{url}/reset/", json={"seed": 1})
    assert client.post(f"{url}/step/", json={"action": 1}).status_code == 200


@pytest.mark.parametrize("frames", [10**9, [2, 10**9]])
def test_ataris_frames_are_counted(refused, frames):
    pytest.importorskip("ale_py")
    refused("ALE/Pong-v5", kwargs={"frameskip": frames})


@pytest.mark.parametrize("name", ["frame_skip", "noop_max"])
def test_ataris_preprocessing_is_counted(refused, name):
    pytest.importorskip("ale_py")
    wrapper = {"name": "AtariPreprocessing", "kwargs": {name: 10**9}}
    refused("ALE/Pong-v5", kwargs={"frameskip": 1}, wrappers=[wrapper])


@pytest.mark.parametrize(
    "kwargs", [{"frame_skip": 10**9}, {"width": 10**5}, {"height": 10**5}, {"max_geom": 10**9}]
)
def test_mujocos_arguments_are_bounded(refused, kwargs):
    pytest.importorskip("mujoco")
    refused("Hopper-v5", kwargs=kwargs)


@pytest.mark.parametrize("name", ["stack_num", "img_height", "img_width", "batch_size"])
def test_ataris_own_vector_environment_gets_no_argument_that_hangs_it(refused, name):
    pytest.importorskip("ale_py")
    how = {"num_envs": 2, "vectorization_mode": "vector_entry_point", "kwargs": {name: 0}}
    assert f"'{name}' must be at least" in refused("ALE/Pong-v5", **how)


def test_arguments_are_only_so_long(refused, create):
    create("FrozenLake-v1", kwargs={"desc": ["S" + "F" * 99] * 99 + ["F" * 99 + "G"]})
    assert "at most 65,536 characters of JSON, not 1,00" in refused(
        "FrozenLake-v1", kwargs={"desc": ["S" * 1000] * 1000}
    )


def test_the_arguments_of_other_modules_mean_what_they_want(create):
    create("faulty_envs:Drawing-v0", kwargs={"frame": "x" * 100_000})


def test_there_are_only_so_many_wrappers(client, create):
    wrapper = {"name": "TimeLimit", "kwargs": {"max_episode_steps": 9}}
    create(wrappers=[wrapper] * 32)
    answer = client.post("/v1/envs/", json={"env_id": "CartPole-v1", "wrappers": [wrapper] * 33})
    assert (answer.status_code, answer.json["code"]) == (400, "invalid_parameter")
    assert "at most 32, not 33" in answer.json["message"]


@pytest.mark.parametrize("options", [{"low": 0, "high": 1e17}, {"low": -1e17}, {"low": -(10**309)}])
@pytest.mark.parametrize("num_envs", [None, 2])
def test_an_angle_is_turned_back_only_so_often(client, create, options, num_envs):
    url = create("Acrobot-v1", num_envs=num_envs)
    answer = client.post(f"{url}/reset/", json={"options": options})
    assert (answer.status_code, answer.json["code"]) == (400, "invalid_parameter")
    assert "of Acrobot-v1 must be between -100,000 and 100,000" in answer.json["message"]
    answer = client.post(f"{url}/reset/", json={"options": {"low": -0.2, "high": 0.2}})
    assert answer.status_code == 200
