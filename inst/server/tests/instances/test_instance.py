import contextlib
import threading

import faulty_envs
import gymnasium
import numpy as np
import pytest

from gym_server.envs.config import EnvConfig
from gym_server.instances.factory import make_instance
from gym_server.rendering.render_thread import RenderThread


def play(client, url, seed, steps):
    observations = [client.post(f"{url}/reset/", json={"seed": seed}).json["observation"]]
    for _ in range(steps):
        action = client.get(f"{url}/action_space/sample").json["action"]
        observations.append(client.post(f"{url}/step/", json={"action": action}).json)
    return observations


def in_process(env_id, **options):
    env = gymnasium.make(env_id)
    observation, _ = env.reset(**options)
    return [float(number) for number in observation]


def test_observations_are_those_of_gymnasium(client, create):
    url = create()
    env = gymnasium.make("CartPole-v1")
    observation, _ = env.reset(seed=3)
    assert client.post(f"{url}/reset/", json={"seed": 3}).json["observation"] == list(observation)
    for action in (0, 1, 1, 0, 1):
        observation, reward, *_ = env.step(action)
        answer = client.post(f"{url}/step/", json={"action": action}).json
        assert np.array_equal(np.array(answer["observation"], np.float32), observation)
        assert answer["reward"] == reward


def test_the_same_seed_gives_the_same_episode_and_the_same_samples(client, create):
    assert play(client, create(), 7, 8) == play(client, create(), 7, 8)
    assert play(client, create(), 7, 8) != play(client, create(), 8, 8)


def test_seed_0_is_a_seed(client, create):
    url = create()
    answer = client.post(f"{url}/reset/", json={"seed": 0}).json
    assert answer["observation"] == in_process("CartPole-v1", seed=0)


def test_the_seed_of_creation_serves_the_first_reset_that_has_none(client, create):
    url = create(seed=5)
    assert client.post(f"{url}/reset/").json["observation"] == in_process("CartPole-v1", seed=5)
    assert client.post(f"{url}/reset/").json["observation"] != in_process("CartPole-v1", seed=5)


@pytest.mark.parametrize("how", [{}, {"num_envs": 2, "vectorization_mode": "sync"}])
def test_the_reset_after_one_with_a_seed_goes_on_with_its_generator(client, create, how):
    url = create(seed=5, **how)
    client.post(f"{url}/reset/", json={"seed": 42})
    env = gymnasium.make_vec("CartPole-v1", **how) if how else gymnasium.make("CartPole-v1")
    env.reset(seed=42)
    observation, _ = env.reset()
    assert client.post(f"{url}/reset/").json["observation"] == observation.tolist()


@pytest.mark.parametrize("seed", [0, 5])
def test_the_seed_of_creation_seeds_the_action_space_at_once(client, create, seed):
    def samples(url):
        return [client.get(f"{url}/action_space/sample").json["action"] for _ in range(20)]

    assert samples(create("Pendulum-v1", seed=seed)) == samples(create("Pendulum-v1", seed=seed))


def test_a_seed_is_not_lost_to_a_reset_that_failed(client, create):
    url = create("faulty_envs:RaisesInReset-v0", seed=5)
    assert client.post(f"{url}/reset/").status_code == 500
    answer = client.post(f"{url}/reset/", json={"options": {"fix": True}}).json
    assert answer["info"]["seed"] == 5


def test_options_reach_the_environment(client, faulty):
    answer = client.post(f"{faulty('Counting')}/reset/", json={"options": {"x": [1]}}).json
    assert answer["info"]["options"] == {"x": [1]}


def test_done_is_terminated_or_truncated(client, create):
    url = create(kwargs={"max_episode_steps": 2})
    client.post(f"{url}/reset/", json={"seed": 0})
    flags = [client.post(f"{url}/step/", json={"action": 1}).json for _ in range(2)]
    assert [(f["terminated"], f["truncated"], f["done"]) for f in flags] == [
        (False, False, False),
        (False, True, True),
    ]


@pytest.mark.parametrize("route", ["step/", "render/"])
def test_before_the_first_reset_there_is_nothing_to_do(client, create, route):
    url = create()
    call = client.get if route == "render/" else client.post
    answer = call(f"{url}/{route}", json={"action": 0})
    assert (answer.status_code, answer.json["code"]) == (400, "reset_needed")


def test_after_done_gymnasium_decides(client, faulty):
    url = faulty("Counting", length=1)
    client.post(f"{url}/reset/")
    answers = [client.post(f"{url}/step/", json={"action": 0}) for _ in range(3)]
    assert [answer.status_code for answer in answers] == [200, 200, 200]
    assert client.get(url).json["needs_reset"] is True


def test_a_refused_action_does_not_move_the_environment(client, faulty):
    url = faulty("Counting")
    client.post(f"{url}/reset/")
    for action in (2, -1, 0.5, "0", [0], {}, ""):
        answer = client.post(f"{url}/step/", json={"action": action})
        assert (answer.status_code, answer.json["code"]) == (400, "action_not_in_space")
        assert "Discrete(2)" in answer.json["message"]
    assert client.post(f"{url}/step/", json={"action": 0}).json["observation"] == [1]
    assert client.get(url).json["steps"] == 1


def test_an_action_arrives_in_the_spaces_dtype_and_shape(client, faulty):
    url = faulty("Echo", dtype="uint8", low=0, high=255, shape=[2, 2])
    client.post(f"{url}/reset/")
    answer = client.post(f"{url}/step/", json={"action": [[0, 1], [254, 255.0]]}).json
    assert answer["observation"] == [[0, 1], [254, 255]]
    assert answer["info"] == {"dtype": "uint8", "shape": [2, 2]}


@pytest.mark.parametrize("value", [2**62 - 1, 2**53 + 1])
def test_large_integers_keep_every_digit(client, faulty, value):
    url = faulty("Echo", dtype="int64", low=0, high=2**62)
    client.post(f"{url}/reset/")
    assert client.post(f"{url}/step/", json={"action": value}).json["observation"] == [value]


def test_doubles_keep_every_digit(client, faulty):
    url = faulty("Echo", dtype="float64")
    client.post(f"{url}/reset/")
    assert client.post(f"{url}/step/", json={"action": 1 / 3}).json["observation"] == [1 / 3]


def test_what_is_not_a_number_travels_as_its_name(client, faulty):
    url = faulty("NotANumber")
    expected = ["NaN", "Infinity", "-Infinity", float(np.float32(0.1))]
    assert client.post(f"{url}/reset/").json["observation"] == expected
    answer = client.post(f"{url}/step/", json={"action": 0}).json
    assert answer["observation"] == expected
    assert answer["reward"] == "Infinity"
    assert answer["info"]["array"] == [[1, 2], [3, 4]]
    assert answer["info"]["nan"] == "NaN"
    assert answer["info"]["flag"] is True
    assert answer["info"]["big"] == 2**62
    assert answer["info"]["7"] == {"nested": [0.5, [1]]}
    assert answer["done"] is False


@pytest.mark.parametrize(
    ("kind", "last_line"),
    [
        ("RaisesInStep", "ValueError: the pole broke"),
        ("ExitsInStep", "SystemExit: good bye"),
    ],
)
def test_an_exception_in_an_environment_is_500_with_its_last_line(
    client, create, faulty, kind, last_line
):
    url, other = faulty(kind), create()
    client.post(f"{url}/reset/")
    answer = client.post(f"{url}/step/", json={"action": 1})
    assert answer.status_code == 500
    assert answer.json["code"] == "environment_error"
    assert answer.json["message"] == f"The environment raised {last_line}"
    assert client.post(f"{other}/reset/").status_code == 200
    assert url.rsplit("/", 1)[1] in client.get("/v1/envs/").json["all_envs"]
    assert client.post(f"{url}/close/").status_code == 204


def test_an_environment_that_failed_may_go_on(client, faulty):
    url = faulty("RaisesInStep")
    client.post(f"{url}/reset/")
    assert client.post(f"{url}/step/", json={"action": 1}).status_code == 500
    assert client.post(f"{url}/step/", json={"action": 0}).status_code == 200


def test_a_failed_reset_needs_another(client, faulty):
    url = faulty("RaisesInReset")
    client.post(f"{url}/reset/", json={"options": {"fix": True}})
    assert client.post(f"{url}/reset/").status_code == 500
    assert client.post(f"{url}/step/", json={"action": 0}).json["code"] == "reset_needed"


def test_an_environment_that_fails_to_close_is_gone_all_the_same(client, faulty):
    url = faulty("RaisesInClose")
    assert client.post(f"{url}/close/").json["message"].endswith("RuntimeError: stuck")
    assert client.get(url).json["code"] == "unknown_instance"


def test_all_about_an_instance(client, create):
    url = create("CartPole-v0", seed=3, kwargs={"sutton_barto_reward": True}, render_mode="human")
    client.post(f"{url}/reset/")
    client.post(f"{url}/step/", json={"action": 0})
    about = client.get(f"{url}/").json
    assert about.pop("age_seconds") >= about.pop("idle_seconds") >= 0
    assert about.pop("action_space") == {"name": "Discrete", "n": 2, "start": 0, "dtype": "int64"}
    assert about.pop("observation_space")["shape"] == [4]
    assert about == {
        "instance_id": url.rsplit("/", 1)[1],
        "env_id": "CartPole-v0",
        "name": None,
        "reward_threshold": 195.0,
        "max_episode_steps": 200,
        "engine": {},
        "warnings": [
            "The environment CartPole-v0 is out of date. You should consider upgrading to version "
            "`v1`."
        ],
        "render_fps": 50,
        "num_envs": None,
        "vectorization_mode": None,
        "num_workers": None,
        "autoreset_mode": None,
        "render_mode": "human",
        "kwargs": {"sutton_barto_reward": True},
        "wrappers": [],
        "seed": 3,
        "steps": 1,
        "episode_steps": 1,
        "needs_reset": False,
        "monitor": None,
        "watched": False,
    }


def test_what_an_environment_does_not_have_is_null(client, faulty):
    about = client.get(faulty("Counting")).json
    assert about["reward_threshold"] is None
    assert about["max_episode_steps"] is None
    assert about["render_fps"] is None
    assert about["render_mode"] is None
    assert about["seed"] is None
    assert about["needs_reset"] is True


def test_being_asked_about_does_not_wait_for_a_step(client, faulty, eventually, tmp_path):
    meeting = tmp_path / "meeting"
    meeting.mkdir()
    url = faulty("Meeting", directory=str(meeting), count=2)
    client.post(f"{url}/reset/")
    step = threading.Thread(
        target=client.post, args=(f"{url}/step/",), kwargs={"json": {"action": 0}}
    )
    step.start()
    eventually(lambda: list(meeting.iterdir()))
    assert client.get(url).status_code == 200
    assert client.get(url).json["steps"] == 0
    (meeting / "the test").touch()
    step.join()
    assert client.get(url).json["steps"] == 1


def test_drawing_and_closing_happen_on_one_thread(client, create, faulty):
    faulty_envs.Drawing.threads.clear()
    urls = [faulty("Drawing") for _ in range(2)]
    for url in urls:
        client.post(f"{url}/reset/")
        client.get(f"{url}/render/")
        client.post(f"{url}/close/")
    assert len(faulty_envs.Drawing.threads) == 1
    assert threading.get_ident() not in faulty_envs.Drawing.threads


ENVIRONMENTS = [
    "CartPole-v1",
    "MountainCar-v0",
    "MountainCarContinuous-v0",
    "Acrobot-v1",
    "Pendulum-v1",
]


@pytest.mark.parametrize("env_id", ENVIRONMENTS)
def test_a_frame_is_drawn_without_a_display(client, create, env_id):
    url = create(env_id)
    client.post(f"{url}/reset/")
    answer = client.get(f"{url}/render/")
    assert (answer.status_code, answer.content_type) == (200, "image/png")
    assert answer.data.startswith(b"\x89PNG")


def test_a_frame_shows_the_current_state(client, faulty):
    url = faulty("Drawing")
    client.post(f"{url}/reset/")
    before = client.get(f"{url}/render").data
    client.post(f"{url}/step/", json={"action": 0})
    assert client.get(f"{url}/render").data != before


def test_a_frame_that_is_not_sent_yet_stays_as_it_is():
    # Others may step an environment while its frame is encoded.
    config = EnvConfig("KeepsItsArrays-v0")
    how = ((), 1, RenderThread(), contextlib.ExitStack())
    instance = make_instance(config, *how)
    instance.reset(None, None)
    frame = instance.render()
    instance.step(0)
    assert (frame == 0).all()


def test_an_environment_that_draws_nothing_cannot_render(client, faulty):
    url = faulty("Counting")
    client.post(f"{url}/reset/")
    assert client.get(f"{url}/render/").json["code"] == "cannot_render"


@pytest.mark.parametrize(
    ("frame", "code"), [("nothing", "cannot_render"), ("raises", "environment_error")]
)
def test_a_frame_that_is_none_is_an_error(client, faulty, frame, code):
    url = faulty("Drawing", frame=frame)
    client.post(f"{url}/reset/")
    assert client.get(f"{url}/render/").json["code"] == code


def test_frames_are_drawn_while_other_environments_close(app, create):
    failures = []

    def draw_and_close(env_id):
        client = app.test_client()
        try:
            for _ in range(3):
                made = client.post("/v1/envs/", json={"env_id": env_id}).json
                url = f"/v1/envs/{made['instance_id']}"
                client.post(f"{url}/reset/")
                for _ in range(3):
                    answer = client.get(f"{url}/render/")
                    assert answer.status_code == 200, answer.json
                assert client.post(f"{url}/close/").status_code == 204
        except AssertionError as failure:
            failures.append(failure)

    threads = [threading.Thread(target=draw_and_close, args=(e,)) for e in ENVIRONMENTS * 2]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures


@pytest.mark.parametrize("num_envs", [None, 2])
def test_an_array_of_one_number_is_a_reward(client, create, monitor_dir, num_envs):
    kwargs = {"reward": [2.5], "info": {}}
    url = create("faulty_envs:Returning-v0", kwargs=kwargs, num_envs=num_envs)
    if num_envs is None:
        client.post(f"{url}/monitor/start/", json={"directory": "run"})
    client.post(f"{url}/reset/")
    answer = client.post(f"{url}/step/", json={"action": 0 if num_envs is None else [0, 1]})
    assert answer.json["reward"] == (2.5 if num_envs is None else [2.5, 2.5])


@pytest.mark.parametrize("num_envs", [None, 2])
@pytest.mark.parametrize("reward", [[1.0, 2.0], None])
def test_a_reward_that_is_no_number_is_named(client, create, num_envs, reward):
    kwargs = {"reward": reward, "info": {}}
    url = create("faulty_envs:Returning-v0", kwargs=kwargs, num_envs=num_envs)
    client.post(f"{url}/reset/")
    answer = client.post(f"{url}/step/", json={"action": 0 if num_envs is None else [0, 1]})
    assert (answer.status_code, answer.json["code"]) == (500, "environment_error")
    shown = "null" if reward is None else "[1.0, 2.0]"
    assert (
        answer.json["message"] == f"A reward must be a number, and the environment returned {shown}"
    )


@pytest.mark.parametrize("num_envs", [None, 2])
@pytest.mark.parametrize("info", [None, ["lives", 3], []])
@pytest.mark.parametrize("in_reset", [True, False])
def test_an_info_that_is_no_dict_is_named(client, create, num_envs, info, in_reset):
    kwargs = {"info": info, "in_reset": in_reset}
    url = create("faulty_envs:Returning-v0", kwargs=kwargs, num_envs=num_envs)
    answer = client.post(f"{url}/reset/")
    if not in_reset:
        answer = client.post(f"{url}/step/", json={"action": 0 if num_envs is None else [0, 1]})
    assert (answer.status_code, answer.json["code"]) == (500, "environment_error")
    assert "An info must be a dict, and the environment returned " in answer.json["message"]
    assert answer.json["hint"] == "return {} for an empty info"
