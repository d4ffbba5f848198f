import sys
from concurrent.futures import ThreadPoolExecutor

import faulty_envs
import gymnasium
import pytest

from gym_server.envs import make, registry
from gym_server.envs.atari import _GAMES, classic_game
from gym_server.envs.config import EnvConfig
from gym_server.envs.make import find_spec
from gym_server.errors import GymServerError

MALFORMED = "Attempted to look up malformed environment ID"


def make_simple(env_id, render_mode, kwargs, allowed):
    config = EnvConfig(env_id, render_mode=render_mode, kwargs=kwargs)
    return make.make_env(config, allowed)


def refusal(env_id, render_mode=None, kwargs=None, allowed=()):
    with pytest.raises(GymServerError) as caught:
        make_simple(env_id, render_mode, kwargs or {}, allowed)
    return caught.value


@pytest.mark.parametrize(
    "env_id", ["bad string", "", "CartPole-v1 ", "a:b:CartPole-v1", ":CartPole-v1", "../x:Y-v0"]
)
def test_a_malformed_id_gets_the_classic_words(env_id):
    refused = refusal(env_id)
    assert (refused.code, refused.message) == ("malformed_env_id", f"{MALFORMED} '{env_id}'")


def test_an_id_that_is_no_string_is_malformed():
    assert refusal(5).message == f"{MALFORMED} '5'"


def test_a_deprecated_id_names_its_successor():
    refused = refusal("FrozenLake-v0")
    assert refused.code == "deprecated_env_id"
    assert refused.message == "The environment 'FrozenLake-v0' is deprecated"
    assert refused.hint == "use FrozenLake-v1"
    assert refusal("LunarLander-v2").hint == "use LunarLander-v3"


def test_an_unknown_id_names_the_nearest():
    refused = refusal("CartPol-v1")
    assert refused.code == "unknown_env_id"
    assert refused.message == "There is no environment 'CartPol-v1'"
    assert refused.hint.startswith("did you mean CartPole-v1")


def test_an_id_in_lower_case_is_unknown_and_not_malformed():
    refused = refusal("cartpole-v1")
    assert (refused.code, refused.message) == (
        "unknown_env_id",
        "There is no environment 'cartpole-v1'",
    )
    assert refused.hint.startswith("did you mean CartPole-v1")


CLASSIC_ATARI = {
    "Breakout-v0": "ALE/Breakout-v5",
    "Pong-v0": "ALE/Pong-v5",
    "Skiing-v0": "ALE/Skiing-v5",
    "pong-v0": "ALE/Pong-v5",
    "Pong": "ALE/Pong-v5",
    "SpaceInvadersNoFrameskip-v4": "ALE/SpaceInvaders-v5",
    "UpNDownDeterministic-v4": "ALE/UpNDown-v5",
    "MsPacman-ram-v0": "ALE/MsPacman-v5",
    "Qbert-ramNoFrameskip-v4": "ALE/Qbert-v5",
}


@pytest.fixture
def no_atari(monkeypatch):
    """Simulate that ale_py is not installed."""
    monkeypatch.setattr(registry, "_registered", set())
    monkeypatch.setitem(sys.modules, "ale_py", None)
    known = dict(gymnasium.registry)
    for env_id, spec in known.items():
        if str(spec.entry_point).startswith("ale_py"):
            monkeypatch.delitem(gymnasium.registry, env_id)


@pytest.mark.parametrize(("env_id", "today"), CLASSIC_ATARI.items())
def test_a_classic_atari_id_gets_the_hint_that_todays_gets(no_atari, env_id, today):
    refused, wanted = refusal(env_id), refusal(today)
    assert (refused.code, refused.extra) == ("missing_dependency", "atari")
    assert refused.message == f"{env_id}, today {today}, needs the server's extra 'atari'"
    assert refused.hint == wanted.hint


def test_a_classic_atari_id_that_ale_does_not_have_names_todays():
    pytest.importorskip("ale_py")
    refused = refusal("Pong-ram-v0")
    assert refused.code == "unknown_env_id"
    assert refused.hint == 'use ALE/Pong-v5 with kwargs {"obs_type": "ram"}'


def test_the_games_of_classic_gym_are_those_that_ale_has():
    pytest.importorskip("ale_py")
    assert find_spec("ALE/Pong-v5", ()).id == "ALE/Pong-v5"
    for game in _GAMES.split():
        assert f"ALE/{game}-v5" in gymnasium.registry
        assert classic_game(f"{game}-v0") == (f"ALE/{game}-v5", False)
    assert len(_GAMES.split()) == 62


@pytest.mark.parametrize("env_id", ["CartPole-v1", "PongPong-v0", "ram-v0", "Blackjack-v1"])
def test_another_id_is_no_atari_game(env_id):
    assert classic_game(env_id) is None


def test_what_cannot_be_made_in_any_way_is_not_offered():
    assert "Pusher-v4" not in (refusal("Pushr-v4").hint or "")
    assert "Pusher-v2" not in (refusal("Pushr-v2").hint or "")


@pytest.mark.parametrize("env_id", ["Pusher-v4", "Ant-v2"])
def test_what_cannot_be_made_gives_the_reason_of_the_registry(env_id, monkeypatch):
    pytest.importorskip("mujoco")
    reason = registry.search(env_id, ())[0]["reason"]
    assert reason is not None
    refused = refusal(env_id)
    assert refused.code == "missing_dependency"
    assert refused.message == f"{env_id} cannot be made: {reason}"


def test_an_id_that_is_like_nothing_gets_no_hint():
    assert refusal("Zzzzzzzz-v0").hint is None


def test_a_version_that_never_was_is_unknown():
    refused = refusal("CartPole-v77")
    assert (refused.code, refused.hint) == ("unknown_env_id", "use CartPole-v1")


def test_an_id_without_a_version_is_the_newest():
    assert make_simple("CartPole", None, {}, ()).spec.id == "CartPole-v1"


def test_a_module_that_is_not_allowed_is_not_imported():
    refused = refusal("this:CartPole-v1", allowed=["faulty_envs"])
    assert refused.code == "module_not_allowed"
    assert "--allow-module this" in refused.hint
    assert "this" not in sys.modules


def test_allowing_a_package_does_not_allow_what_is_in_it():
    assert refusal("json.tool:X-v0", allowed=["json"]).code == "module_not_allowed"


def test_an_allowed_module_registers_its_environments():
    assert (
        make_simple("faulty_envs:Counting-v0", None, {}, ["faulty_envs"]).spec.id == "Counting-v0"
    )


def test_an_allowed_module_that_is_missing_is_a_missing_dependency():
    refused = refusal("no_such_module:X-v0", allowed=["no_such_module"])
    assert refused.code == "missing_dependency"


def test_modules_are_imported_one_at_a_time(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("first", "second"):
        (tmp_path / f"imported_{name}.py").write_text(
            "import time, faulty_envs\n"
            "faulty_envs.importing.append(0)\n"
            "time.sleep(0.2)\n"
            "together = len(faulty_envs.importing)\n"
            "faulty_envs.importing.pop()\n"
            "class Env(faulty_envs.Counting):\n"
            "    def __init__(self):\n"
            "        assert together == 1\n"
        )
        monkeypatch.setitem(
            gymnasium.registry,
            f"{name}-v0",
            gymnasium.envs.registration.EnvSpec(f"{name}-v0", f"imported_{name}:Env"),
        )
    monkeypatch.setattr(faulty_envs, "importing", [], raising=False)
    with ThreadPoolExecutor() as pool:
        ids = ("first-v0", "second-v0")
        made = list(pool.map(lambda env_id: make_simple(env_id, None, {}, ()), ids))
    assert [env.spec.id for env in made] == list(ids)


def test_a_package_that_is_missing_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    refused = refusal("Ant-v5")
    assert refused.code == "missing_dependency"
    assert "mujoco" in refused.message.lower()


def test_pictures_are_the_default_where_they_can_be_drawn():
    assert make_simple("CartPole-v1", None, {}, ()).render_mode == "rgb_array"
    assert make_simple("faulty_envs:Counting-v0", None, {}, ["faulty_envs"]).render_mode is None


def test_no_window_is_opened():
    assert make_simple("CartPole-v1", "human", {}, ()).render_mode == "rgb_array"


@pytest.mark.parametrize("render_mode", ["ansi", "rgb_array_list", "RGB_ARRAY"])
def test_another_render_mode_is_refused_with_what_is_supported(render_mode):
    refused = refusal("CartPole-v1", render_mode)
    assert refused.code == "invalid_parameter"
    assert '"rgb_array" or "human"' in refused.message


@pytest.mark.parametrize("render_mode", ["rgb_array", "human", "ansi"])
def test_an_environment_that_draws_nothing_has_no_render_mode(render_mode):
    refused = refusal("faulty_envs:OldRenderModes-v0", render_mode, allowed=["faulty_envs"])
    assert refused.code == "invalid_parameter"
    assert "left out" in refused.message


def test_kwargs_reach_the_environment():
    env = make_simple(
        "CartPole-v1", None, {"sutton_barto_reward": True, "max_episode_steps": 7}, ()
    )
    assert env.unwrapped._sutton_barto_reward is True
    assert env.spec.max_episode_steps == 7


@pytest.mark.parametrize("kwargs", [{"gravitation": 1}, {"id": "Acrobot-v1"}])
def test_kwargs_that_nobody_knows_are_refused_in_the_environments_words(kwargs):
    refused = refusal("CartPole-v1", kwargs=kwargs)
    assert refused.code == "invalid_kwargs"
    assert next(iter(kwargs)) in refused.message


def test_kwargs_must_not_carry_render_mode():
    assert refusal("CartPole-v1", kwargs={"render_mode": "human"}).code == "invalid_kwargs"


def test_a_constructor_that_raises_is_the_environments_error():
    refused = refusal("faulty_envs:RaisesInConstructor-v0", allowed=["faulty_envs"])
    assert refused.code == "environment_error"
    assert refused.message == "The environment raised RuntimeError: no such table"


def test_an_id_without_its_namespace_names_the_whole_id():
    assert refusal("Acrobot-v77").hint == "use Acrobot-v1"
    pytest.importorskip("ale_py")
    assert refusal("Breakout-v5").hint == "use ALE/Breakout-v5"
