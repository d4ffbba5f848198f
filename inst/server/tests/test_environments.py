from collections import Counter

import environments
import gymnasium
import numpy as np
import pytest

from gym_server.protocol.safetensors import TENSORS, read

OTHERS = [env_id for env_id in environments.runnable() if env_id not in environments.ATARI]
ROBOTS = [i for i in OTHERS if environments.family(gymnasium.spec(i)) == "mujoco"]
# Older versions, and all robots but one, are similar and take seconds each.
SIMILAR = {*environments.older(), *ROBOTS} - {"HalfCheetah-v5"}
PLAYED = [env_id for env_id in OTHERS if environments.ALL or env_id not in SIMILAR]
ATARI = environments.atari_played()


def played(client, url, how):
    """Return the responses to a reset and a step, and the frame after these."""
    first = client.post(f"{url}/reset/", headers={"Accept": how})
    action = client.get(f"{url}/action_space/sample").json["action"]
    later = client.post(f"{url}/step/", json={"action": action}, headers={"Accept": how})
    assert later.status_code == 200, later.json
    drawn = client.get(f"{url}/render/", headers={"Accept": TENSORS})
    frame = read(drawn.data).tensors["frame"].array()
    height, width, channels = frame.shape
    assert (frame.dtype, channels) == (np.uint8, 3)
    assert min(height, width) > 50
    return first, later, frame


@pytest.mark.parametrize("env_id", PLAYED)
def test_it_is_made_reset_stepped_and_drawn(client, create, env_id):
    url = create(env_id, seed=1)
    first, later, frame = played(client, url, "application/json")
    # Some observations are out of bounds, but all have the right shape.
    assert np.shape(later.json["observation"]) == np.shape(first.json["observation"])
    assert np.ptp(frame) > 50
    assert client.post(f"{url}/close/").status_code == 204


@pytest.mark.parametrize("env_id", ATARI)
def test_an_atari_game_is_made_reset_stepped_and_drawn(client, create, env_id):
    # Without a seed, because for a seed the emulator loads the game again.
    url = create(env_id)
    first, later, frame = played(client, url, TENSORS)
    before, after = (read(one.data).tensors["observation"].array() for one in (first, later))
    assert after.shape == before.shape
    # Some start black, but the frame equals the observation.
    assert np.array_equal(frame, after)
    assert client.post(f"{url}/close/").status_code == 204


def test_every_kind_of_atari_id_is_played():
    kinds = Counter(map(environments.kind_of_id, ATARI))
    assert kinds.keys() == set(map(environments.kind_of_id, environments.ATARI))
    assert all(count > 1 for count in kinds.values())


@pytest.mark.parametrize(("env_id", "why"), environments.not_runnable().items())
def test_what_cannot_run_says_so(client, env_id, why):
    answer = client.post("/v1/envs/", json={"env_id": env_id})
    assert answer.status_code == 400, why
    assert answer.json["code"] in ("missing_dependency", "module_not_allowed"), answer.json
    registered = client.get(f"/v1/registry/?search={env_id}").json["environments"]
    assert [entry["available"] for entry in registered if entry["id"] == env_id] == [False]


def test_none_is_left_out(client):
    ids = {entry["id"] for entry in client.get("/v1/registry/").json["environments"]}
    known = {*environments.runnable(), *environments.not_runnable()}
    assert {env_id for env_id in ids if env_id not in known} <= set(_of_the_tests())


def _of_the_tests():
    import faulty_envs  # noqa: F401 - it registers them

    return [
        spec.id
        for spec in gymnasium.registry.values()
        if getattr(spec.entry_point, "__module__", "").startswith("faulty_envs.")
    ]
