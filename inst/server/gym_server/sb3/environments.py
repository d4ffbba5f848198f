"""The environments that an algorithm trains in, and that its policy is judged by."""

from __future__ import annotations

import contextlib
import importlib
import inspect
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from gymnasium.wrappers import FrameStackObservation, ReshapeObservation
from stable_baselines3.common.atari_wrappers import AtariWrapper
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecNormalize

from gym_server.envs import wrappers
from gym_server.envs.config import Wrapper
from gym_server.envs.make import check_kwargs, find_spec, make_from_spec
from gym_server.errors import GymServerError
from gym_server.sb3.failures import JobError
from gym_server.vector_envs.sub_env import ThisThread

# PyTorch's optimizers import triton, if it is installed. It has a copy of LLVM, and so has Mesa,
# which draws MuJoCo without a display: the two get along only in this order.
with contextlib.suppress(ImportError):
    importlib.import_module("triton")

# What an agent sees of an Atari game: pictures of this width, this many of them.
_SCREEN, _STACK = 84, 4


def single_env(
    job: dict[str, Any], trains: bool = False, render_mode: str | None = None
) -> gymnasium.Env:
    """Return an environment.

    Args:
        job: the job, with ``algorithm``, ``env_id``, ``env_kwargs``, ``wrappers``, and ``atari``:
            whether its pictures are those of a game.
        trains: whether an algorithm learns from it. Its rewards are then clipped, and an episode
            ends with a life.
        render_mode: "rgb_array" for one that can be drawn.
    """
    kwargs = dict(job["env_kwargs"])
    atari = _preprocessing(kwargs) if job["atari"] else None
    if atari is not None:
        # AtariWrapper repeats actions itself, because it looks at the two last pictures.
        kwargs["frameskip"] = 1
    try:
        spec = find_spec(job["env_id"], ())
        check_kwargs(kwargs)
        env = make_from_spec(spec, render_mode, kwargs)
        chosen = [Wrapper(one["name"], one.get("kwargs") or {}) for one in job["wrappers"]]
        env = wrappers.wrap(env, chosen, ThisThread())
    except GymServerError as refusal:
        raise JobError(refusal.message, refusal.hint, argument="env") from refusal
    if trains:
        env = Monitor(env)
    if atari is not None:
        env = AtariWrapper(env, **atari, terminal_on_life_loss=trains, clip_reward=trains)
        env = FrameStackObservation(env, _STACK, padding_type="zero")
        env = ReshapeObservation(env, (_STACK, _SCREEN, _SCREEN))
    if job["algorithm"] == "MaskablePPO":
        env = _Masked(env)
        # Whether there are masks is known only then.
        env.reset()
    return env


def vector_env(job: dict[str, Any]) -> VecEnv:
    """Return a vector environment of Stable-Baselines3 for training."""
    if job["atari"]:
        # Its errors name what is wrong with the arguments.
        single_env(job).close()
        # Only games need ale-py.
        from gym_server.sb3 import atari

        if not job["wrappers"] and atari.KWARGS.issuperset(job["env_kwargs"]):
            kwargs = dict(job["env_kwargs"])
            treatment = _preprocessing(kwargs)
            return atari.AtariVecEnv(
                job["env_id"], job["num_envs"], kwargs, **treatment, frame_stack=_STACK
            )
    made: VecEnv = DummyVecEnv([lambda: single_env(job, trains=True)] * job["num_envs"])
    return made


def normalized(env: VecEnv, job: dict[str, Any], discount: float) -> VecEnv:
    """Return the vector environment as the job's ``normalize`` wants it."""
    if not job["normalize"]:
        return env
    chosen = job["normalize"] if isinstance(job["normalize"], dict) else {}
    known = set(inspect.signature(VecNormalize).parameters) - {"venv", "training", "norm_obs_keys"}
    for name in chosen:
        if name not in known:
            message = f'VecNormalize has no argument "{name}".'
            raise JobError(message, argument="normalize", known=sorted(known))
    if chosen.get("norm_obs", True) and not isinstance(env.observation_space, Box):
        kind = type(env.observation_space).__name__
        raise JobError(
            f"The observations of {job['env_id']} are a {kind}, and only a Box is normalized.",
            "`normalize = list(norm_obs = FALSE)` normalizes the rewards alone.",
            argument="normalize",
        )
    return VecNormalize(env, **{"gamma": discount, **chosen})


def has_limit(job: dict[str, Any]) -> bool:
    """Return whether every episode ends; a game does after half an hour."""
    return job["atari"] or gymnasium.spec(job["env_id"]).max_episode_steps is not None


def preprocessing(job: dict[str, Any]) -> dict[str, Any] | None:
    """Return what was done to a game for training; None for another environment."""
    if not job["atari"]:
        return None
    of_game = {**gymnasium.spec(job["env_id"]).kwargs, **job["env_kwargs"]}
    ours = {"frame_stack": _STACK, "clip_reward": True, "terminal_on_life_loss": True}
    return {
        **_preprocessing(dict(job["env_kwargs"])),
        **ours,
        "repeat_action_probability": of_game["repeat_action_probability"],
    }


def _preprocessing(kwargs: dict[str, Any]) -> dict[str, Any]:
    """Return the arguments of AtariWrapper, one of which is taken from the environment's."""
    skip = kwargs.pop("frameskip", 4)
    if isinstance(skip, list):
        raise JobError("`frameskip` must be one number for a CnnPolicy.", argument="env_kwargs")
    return {"noop_max": 30, "frame_skip": int(skip), "screen_size": _SCREEN}


class _Masked(gymnasium.Wrapper):
    """Offers the mask of valid actions in the infos by the method that MaskablePPO looks for."""

    mask: Any = None

    def reset(self, **kwargs: Any) -> tuple[Any, dict[str, Any]]:
        observation, info = self.env.reset(**kwargs)
        return observation, self._note(info)

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        *outcome, info = self.env.step(action)
        return (*outcome, self._note(info))

    def _note(self, info: dict[str, Any]) -> dict[str, Any]:
        if hasattr(self.env.unwrapped, "action_masks"):
            self.mask = self.env.unwrapped.action_masks()
        elif "action_mask" in info:
            self.mask = info["action_mask"]
        else:
            raise JobError(
                f"{self.env.spec and self.env.spec.id} does not say which actions are valid.",
                'MaskablePPO needs `info["action_mask"]`, as Taxi-v4 has; "PPO" does not.',
                argument="algorithm",
            )
        return info

    def action_masks(self) -> Any:
        """Return whether each action is valid."""
        return np.asarray(self.mask, dtype=bool)
