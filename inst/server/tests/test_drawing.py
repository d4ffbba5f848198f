"""Every family of environments draws from any thread while others close, and can be recorded.

``GYM_TEST_DRAWING=all``, which ``make soak`` sets, draws more environments of each family.
"""

import gc
import os
import sys
import threading

import numpy as np
import pytest

from gym_server.envs.extras import is_available
from gym_server.envs.registry import look_up
from gym_server.protocol.safetensors import TENSORS, read

pytestmark = pytest.mark.slow

# One of each way to draw: pygame, pygame in each step, OpenGL, and an emulator.
FAMILIES = ["CartPole-v1", "CarRacing-v3", "Ant-v5", "ALE/Pong-v5"]
if os.environ.get("GYM_TEST_DRAWING") == "all":
    FAMILIES += ["FrozenLake-v1", "Taxi", "LunarLander-v3", "Hopper-v4"]


@pytest.fixture
def installed():
    def installed(env_id):
        try:
            return is_available(look_up(env_id))
        except Exception:
            return False

    return installed


def test_all_families_draw_from_any_thread_while_others_close(app, installed):
    failures = []
    # Some observe pictures, which take long as JSON.
    in_tensors = {"Accept": TENSORS}

    def draw_and_close(env_id):
        client = app.test_client()
        try:
            for seed in range(2):
                made = client.post("/v1/envs/", json={"env_id": env_id}).json
                url = f"/v1/envs/{made['instance_id']}"
                client.post(f"{url}/reset/", json={"seed": seed}, headers=in_tensors)
                for _ in range(2):
                    action = client.get(f"{url}/action_space/sample").json["action"]
                    client.post(f"{url}/step/", json={"action": action}, headers=in_tensors)
                    answer = client.get(f"{url}/render/", headers=in_tensors)
                    assert answer.status_code == 200, answer.json
                    assert np.ptp(read(answer.data).tensors["frame"].array()) > 50
                assert client.post(f"{url}/close/").status_code == 204
        except Exception as failure:
            failures.append((env_id, failure))

    families = [env_id for env_id in FAMILIES if installed(env_id)]
    threads = [threading.Thread(target=draw_and_close, args=(e,)) for e in families * 2]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures


@pytest.mark.parametrize("env_id", FAMILIES)
def test_it_is_recorded(client, create, installed, monitor_dir, env_id):
    pytest.importorskip("moviepy")
    if not installed(env_id):
        pytest.skip("not installed")
    limit = {"name": "TimeLimit", "kwargs": {"max_episode_steps": 3}}
    url = create(env_id, wrappers=[limit])
    start = {"directory": "run", "video_callable": True}
    assert client.post(f"{url}/monitor/start/", json=start).status_code == 204
    client.post(f"{url}/reset/", json={"seed": 1})
    done = False
    while not done:
        action = client.get(f"{url}/action_space/sample").json["action"]
        done = client.post(f"{url}/step/", json={"action": action}).json["done"]
    assert client.post(f"{url}/monitor/close/").status_code == 204
    assert (monitor_dir / "run" / "rl-video-episode-0.mp4").stat().st_size > 0


def test_car_racing_moves_on_the_render_thread(app, create, client, installed, monkeypatch):
    if not installed("CarRacing-v3"):
        pytest.skip("not installed")
    url = create("CarRacing-v3")
    env = app._instances.get(url.rsplit("/", 1)[1]).gym_env.unwrapped
    threads = set()
    for name in ("reset", "step", "render"):
        original = getattr(env, name)

        def noting(*args, original=original, **kwargs):
            threads.add(threading.get_ident())
            return original(*args, **kwargs)

        monkeypatch.setattr(env, name, noting)
    client.post(f"{url}/reset/")
    assert client.post(f"{url}/step/", json={"action": [0, 0, 0]}).status_code == 200
    client.get(f"{url}/render/")
    assert threads == {app._renderer.run(threading.get_ident)}


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="OpenGL without a display")
@pytest.mark.parametrize(
    ("variables", "chosen"),
    [
        ({}, "egl"),
        ({"DISPLAY": ":99"}, None),
        ({"WAYLAND_DISPLAY": "x"}, None),
        ({"MUJOCO_GL": "osmesa"}, "osmesa"),
    ],
)
def test_opengl_is_chosen_for_a_machine_without_a_display(variables, chosen, monkeypatch):
    from gym_server.envs import mujoco

    if not mujoco._has_egl():
        pytest.skip("this machine has no EGL")
    # MuJoCo itself reads the variable only once, when it is first imported. Each variable is first
    # set, so that it is restored even if it was not.
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "MUJOCO_GL"):
        monkeypatch.setenv(name, "")
        monkeypatch.delenv(name)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    mujoco.choose_gl()
    assert os.environ.get("MUJOCO_GL") == chosen


def test_mujoco_warns_in_the_log_and_leaves_no_file(
    client, installed, monkeypatch, tmp_path, caplog
):
    if not installed("HalfCheetah-v5"):
        pytest.skip("not installed")
    monkeypatch.chdir(tmp_path)
    assert client.post("/v1/envs/", json={"env_id": "HalfCheetah-v5"}).status_code == 200
    import mujoco

    for _ in range(2):
        mujoco.get_mju_user_warning()("the model is odd")
    said = [(one.name, one.message) for one in caplog.records]
    assert said.count(("MuJoCo", "the model is odd")) == 1
    assert list(tmp_path.glob("MUJOCO*")) == []


def test_two_mujoco_environments_each_draw_their_own_picture(client, create, installed):
    if not installed("Pusher-v5"):
        pytest.skip("not installed")

    def drawn(url):
        return client.get(f"{url}/render/").data

    first, second = create("Pusher-v5"), create("Hopper-v5")
    for url in (first, second):
        client.post(f"{url}/reset/", json={"seed": 1})
    alone = drawn(first)
    assert drawn(second) != alone
    assert drawn(first) == alone
    # Python may collect the remains of a closed environment at any time.
    client.post(f"{second}/close/")
    client.application._renderer.run(gc.collect)
    assert drawn(first) == alone
