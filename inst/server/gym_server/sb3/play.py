"""Play whole episodes by a policy that stays with Stable-Baselines3, or ask it for actions."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

from gym_server.protocol import safetensors
from gym_server.rendering.png import picture, png
from gym_server.rollouts.episode import Played, play_episode
from gym_server.rollouts.recording import Recorder, result_tensors
from gym_server.rollouts.task import Keep
from gym_server.sb3 import files, policies
from gym_server.sb3.environments import single_env
from gym_server.sb3.failures import in_words
from gym_server.spaces import Rows, tensor_reader, tensor_writer


def play(job: dict[str, Any], folder: Path, stopping: threading.Event) -> dict[str, Any]:
    """Play episodes, and write what comes of them as the server's rollouts have it.

    Args:
        job: the environment; ``seeds``, one for each episode; ``max_steps``; ``keep``, see
            ``Keep``; and ``frames``, whether to draw.
        folder: where the policy is and the results go. ``played`` has a byte for each episode.
        stopping: set when the last episode is to be the one that is played.
    """
    env: Any = single_env(job, render_mode="rgb_array" if job["frames"] else None)
    player = policies.read(folder / "policy.safetensors", env)
    keep = Keep(**dict.fromkeys(job["keep"], True))
    recorder = Recorder(keep, env.observation_space, env.action_space)
    played: list[Played] = []
    error = None
    for number, seed in enumerate(job["seeds"], start=1):
        if stopping.is_set():
            break
        drawn = _Drawn(env, folder / "frames" / str(number)) if job["frames"] else env
        recorder.begin()
        try:
            played.append(play_episode(drawn, player, seed, job["max_steps"], recorder))
        except Exception as failure:
            error = in_words(failure)
            break
        recorder.end()
        (folder / "played").write_bytes(bytes(number))
    earned, lengths, *flags = zip(*played, strict=True) if played else ((), (), (), ())
    tensors = {**result_tensors(earned, lengths, flags[0], flags[1]), **recorder.tensors()}
    content = safetensors.write(tensors, {})
    files.write(folder / "episodes.safetensors", content)
    return {"error": error}


def act(job: dict[str, Any], folder: Path, stopping: threading.Event) -> dict[str, Any]:
    """Write the most likely action for each observation, which is the first one of an episode."""
    env = single_env(job)
    player = policies.read(folder / "policy.safetensors", env)
    player.begin(0)
    # Only an episode knows which actions are valid.
    player.masked = False
    sent = safetensors.read((folder / "observations.safetensors").read_bytes())
    parts = safetensors.Parts(sent.tensors)
    observations = tensor_reader(env.observation_space, "observation")(parts, Rows(job["count"]))
    actions = player.act(observations)
    write = tensor_writer(env.action_space, "action", is_batch=True)
    files.write(
        folder / "actions.safetensors", safetensors.write(write(actions, False).tensors, {})
    )
    return {"error": None}


class _Drawn:
    """An environment that is drawn before and after each step, in files."""

    def __init__(self, env: Any, folder: Path) -> None:
        self.env, self.folder, self.count = env, folder, 0
        folder.mkdir(parents=True)

    def reset(self, **kwargs: Any) -> Any:
        return self._draw(self.env.reset(**kwargs))

    def step(self, action: Any) -> Any:
        return self._draw(self.env.step(action))

    def _draw(self, outcome: Any) -> Any:
        self.count += 1
        content = png(picture(self.env.render()))
        (self.folder / f"{self.count:06}.png").write_bytes(content)
        return outcome
