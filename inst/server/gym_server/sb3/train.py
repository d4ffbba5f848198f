"""Train a policy as a job says, and keep what comes of it in files."""

from __future__ import annotations

import json
import math
import threading
import time
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import sb3_contrib
import stable_baselines3
import torch
from gymnasium.spaces import Box, Dict
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure
from stable_baselines3.common.vec_env import VecEnv

from gym_server.rollouts.episode import play_episode
from gym_server.sb3 import algorithms, checkpoints, policies
from gym_server.sb3.buffers import DeviceRolloutBuffer
from gym_server.sb3.environments import (
    has_limit,
    normalized,
    preprocessing,
    single_env,
    vector_env,
)
from gym_server.sb3.failures import JobError, diverged, in_words

# Where an environment has no limit of its own, a policy may never end an episode.
_LONGEST_EPISODE = 10_000

# Rows of progress.csv in a training.
_ROWS = 100


def train(job: dict[str, Any], folder: Path, stopping: threading.Event) -> dict[str, Any]:
    """Carry out a job.

    Args:
        job: the job.
        folder: where its files go; a checkpoint that is there goes on.
        stopping: set when the training is to end at its next step.

    Returns:
        What ``result.json`` says. A failure during training is its ``error``, beside the policy.
    """
    # Looked at first, because anything else takes seconds.
    make = algorithms.algorithm(job["algorithm"])
    if job["device"].startswith("cuda") and not torch.cuda.is_available():
        raise JobError(
            "PyTorch finds no GPU here.", 'device = "cpu" trains without.', argument="device"
        )
    env = vector_env(job)
    treated = preprocessing(job)
    arguments = algorithms.arguments_of(make, job["arguments"], env.action_space)
    env = normalized(env, job, arguments.get("gamma", 0.99))
    before = checkpoints.state_of(folder)
    begun = before.get("num_timesteps", 0)
    model = _model(make, env, arguments, job, job["seed"] + begun)
    checkpoints.restore(model, folder)
    model.set_logger(configure(str(folder), ["csv"]))
    callback = _Callback(job, folder, stopping, before)
    # DQN, for instance, ends its exploration after a share of the whole.
    remaining = max(job["total_steps"] - begun, 0)
    error = None
    try:
        if remaining and not stopping.is_set():
            model.learn(remaining, callback, log_interval=None, reset_num_timesteps=begun == 0)
            callback.check_finite()
    except Exception as failure:
        error = in_words(failure)
        callback.go_back()
    callback.finish(keeps=error is None)
    model.logger.close()
    policies.write(folder, model, job)
    return {
        "steps": model.num_timesteps,
        "begun": begun,
        "error": error,
        "device": str(model.device),
        "versions": versions(),
        "preprocessing": treated,
    }


def versions() -> dict[str, str]:
    """Return the versions of the libraries that train."""
    libraries = (stable_baselines3, sb3_contrib, torch, gymnasium)
    return {library.__name__: library.__version__ for library in libraries}


def _model(
    make: type[BaseAlgorithm],
    env: VecEnv,
    arguments: dict[str, Any],
    job: dict[str, Any],
    seed: int,
) -> BaseAlgorithm:
    named: dict[str, Any] = {"seed": seed % 2**31, "device": job["device"], **arguments}
    if job["algorithm"] in ("PPO", "A2C", "TRPO") and not isinstance(env.observation_space, Dict):
        named["rollout_buffer_class"] = DeviceRolloutBuffer
    try:
        return make(job["policy"], env, **named)
    except NotImplementedError as failure:
        message = f"{make.__name__} cannot train in {job['env_id']}: {failure}."
        raise JobError(message, argument="env") from failure
    except (AssertionError, TypeError, ValueError) as failure:
        text = " ".join(str(failure).split())
        if "only supports" in text and "action space" in text:
            takes = "a Box" if isinstance(env.action_space, Box) else f"{env.action_space}"
            raise JobError(
                f"{make.__name__} cannot act in {job['env_id']}, whose actions are {takes}.",
                "DQN and QRDQN need Discrete actions, SAC, TD3, DDPG, TQC and CrossQ a Box; "
                "PPO, A2C and TRPO take both.",
                argument="algorithm",
            ) from failure
        if text.startswith("Policy ") and text.endswith(" unknown"):
            known = list(make.policy_aliases)
            message = f'{make.__name__} has no policy "{job["policy"]}".'
            raise JobError(message, argument="policy", known=known) from failure
        if "NatureCNN" in text:
            raise JobError(
                f"A {job['policy']} sees pictures, not the {env.observation_space} of "
                f"{job['env_id']}.",
                '"MlpPolicy" is for numbers, "MultiInputPolicy" for a Dict of several parts.',
                argument="policy",
            ) from failure
        message = f"{make.__name__} refuses its arguments: {text}"
        raise JobError(message, argument="...") from failure


class _Callback(BaseCallback):
    """Writes rows, evaluates, keeps checkpoints, and ends the training when that is asked for."""

    def __init__(
        self, job: dict[str, Any], folder: Path, stopping: threading.Event, before: dict[str, Any]
    ) -> None:
        super().__init__()
        self.job, self.folder, self.stopping = job, folder, stopping
        self.episodes: list[tuple[float, float]] = []
        self.rows = before.get("rows", 0)
        self.row_at = self.evaluated_at = 0
        self.every = max(job["total_steps"] // _ROWS, 1)
        self.elapsed = before.get("elapsed", 0.0)
        self.began = time.monotonic()
        self.finite: dict[str, torch.Tensor] = {}
        self.player: policies.Player | None = None

    def _on_training_start(self) -> None:
        self.row_at = self.evaluated_at = self.num_timesteps
        if self.num_timesteps == 0 and has_limit(self.job):
            self._evaluate()
        self._remember()

    def _on_step(self) -> bool:
        for info in self.locals["infos"]:
            if "episode" in info:
                self.episodes.append((float(info["episode"]["r"]), float(info["episode"]["l"])))
        if self.stopping.is_set():
            return False
        if self.episodes and self.num_timesteps - self.row_at >= self.every:
            self._row()
        return True

    def _row(self) -> None:
        self.check_finite()
        self._remember()
        self.rows += 1
        due = self.num_timesteps - self.evaluated_at >= self.job["eval_every"]
        if due or self.num_timesteps >= self.job["total_steps"]:
            self._evaluate()
        seconds = self.elapsed + time.monotonic() - self.began
        returns, lengths = zip(*self.episodes or [(math.nan, math.nan)], strict=True)
        values = {
            "time/iterations": self.rows,
            "time/total_timesteps": self.num_timesteps,
            "time/time_elapsed": round(seconds, 3),
            "rollout/ep_rew_mean": np.mean(returns),
            "rollout/ep_rew_min": np.min(returns),
            "rollout/ep_rew_median": np.median(returns),
            "rollout/ep_rew_max": np.max(returns),
            "rollout/ep_len_mean": np.mean(lengths),
        }
        for name, value in values.items():
            self.logger.record(name, value)
        self.logger.dump(self.num_timesteps)
        self.episodes, self.row_at = [], self.num_timesteps
        if due and self.job["checkpoint"]:
            self._keep(seconds)

    def _keep(self, seconds: float) -> None:
        checkpoints.keep(self.model, self.folder, self.rows, seconds)

    def check_finite(self) -> None:
        """Raise JobError if a loss is no number."""
        for name, value in self.logger.name_to_value.items():
            if "loss" in name and not math.isfinite(value):
                raise diverged(name, self.num_timesteps)
        for name, weight in self.model.policy.state_dict().items():
            if not torch.isfinite(weight).all():
                raise diverged(name, self.num_timesteps)

    def _remember(self) -> None:
        for name, weight in self.model.policy.state_dict().items():
            self.finite[name] = weight.detach().clone()

    def go_back(self) -> None:
        """Take the policy of the last row."""
        if self.finite:
            self.model.policy.load_state_dict(self.finite)

    def finish(self, keeps: bool) -> None:
        """Write the last row, and a checkpoint."""
        if keeps and self.num_timesteps > self.row_at:
            self._row()
        if keeps and self.job["checkpoint"] and self.num_timesteps > 0:
            self._keep(self.elapsed + time.monotonic() - self.began)

    def _evaluate(self) -> None:
        """Play whole episodes, each with a seed of its own, and write how they went."""
        self.evaluated_at = self.num_timesteps
        if self.job["eval_episodes"] == 0:
            return
        if self.player is None:
            moments = self.model.get_vec_normalize_env()
            self.player = policies.Player(
                self.model, single_env(self.job), None if moments is None else moments.normalize_obs
            )
        draws = np.random.default_rng([self.job["seed"], self.num_timesteps])
        longest = None if has_limit(self.job) else _LONGEST_EPISODE
        played = []
        for seed in draws.integers(2**31, size=self.job["eval_episodes"]).tolist():
            if self.stopping.is_set():
                return
            played.append(play_episode(self.player.env, self.player, seed, longest, None)[:2])
        returns, lengths = zip(*played, strict=True)
        self.logger.record("eval/mean_reward", np.mean(returns))
        self.logger.record("eval/mean_ep_length", np.mean(lengths))
        row = {"iteration": self.rows, "steps": self.num_timesteps}
        line = json.dumps({**row, "returns": returns, "lengths": lengths})
        with (self.folder / "evaluations.jsonl").open("a", encoding="utf-8") as table:
            table.write(line + "\n")
