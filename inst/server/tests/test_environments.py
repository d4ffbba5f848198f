import environments
import numpy as np
import pytest

from gym_server.protocol.safetensors import TENSORS, read

SAMPLED = environments.sampled()
REST = [env_id for env_id in environments.runnable() if env_id not in SAMPLED]


@pytest.mark.parametrize(
    "env_id", [*SAMPLED, *(pytest.param(env_id, marks=pytest.mark.slow) for env_id in REST)]
)
def test_it_is_made_reset_stepped_and_drawn(client, create, env_id):
    url = create(env_id, seed=1)
    observation = client.post(f"{url}/reset/").json["observation"]
    action = client.get(f"{url}/action_space/sample").json["action"]
    answer = client.post(f"{url}/step/", json={"action": action})
    assert answer.status_code == 200, answer.json
    # Some observations lie outside of what their environments promise, none has another shape.
    assert np.shape(answer.json["observation"]) == np.shape(observation)
    frame = read(client.get(f"{url}/render/", headers={"Accept": TENSORS}).data).tensors["frame"]
    height, width, channels = frame.shape
    assert (frame.dtype, channels) == ("U8", 3)
    assert min(height, width) > 50
    if env_id in environments.ATARI:
        # Some of them are black in the beginning, but what is observed is what is drawn.
        assert np.array_equal(frame.array(), answer.json["observation"])
    else:
        assert np.ptp(frame.array()) > 50
    assert client.post(f"{url}/close/").status_code == 204


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
    import gymnasium

    return [
        spec.id
        for spec in gymnasium.registry.values()
        if getattr(spec.entry_point, "__module__", "").startswith("faulty_envs.")
    ]
