"""Atari games as ale-py's own vector environment steps them, in threads of its own.

It makes the pictures of AtariWrapper, some twice as fast, but for one thing: of the last two
frames it takes the lighter grey, AtariWrapper the lighter of each color. Where something moves,
pixels differ a little.
"""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from ale_py.vector_env import AtariVectorEnv
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env import VecEnv

# Arguments of a game that ale-py's vector environment has, too.
KWARGS = frozenset(
    {"frameskip", "full_action_space", "max_num_frames_per_episode", "repeat_action_probability"}
)


class AtariVecEnv(VecEnv):
    """Games for training: rewards are clipped, and an episode ends with a life.

    The infos have ``episode``, the score and frames of a whole game, as Monitor's.
    """

    def __init__(
        self,
        env_id: str,
        num_envs: int,
        kwargs: dict[str, Any],
        *,
        noop_max: int,
        frame_skip: int,
        screen_size: int,
        frame_stack: int,
    ) -> None:
        """Make the games.

        Args:
            env_id: the game, such as ``"ALE/Pong-v5"``.
            num_envs: how many of them.
            kwargs: arguments of the game, of those in ``KWARGS``.
            noop_max: the largest number of steps without an action at the start.
            frame_skip: for how many frames an action is taken.
            screen_size: width and height of a picture in pixels.
            frame_stack: how many pictures are observed together.
        """
        of_game = gymnasium.spec(env_id).kwargs
        own = {name: value for name, value in of_game.items() if name in KWARGS} | kwargs
        self.frame_skip = own["frameskip"] = frame_skip
        # ``episodic_life`` would begin a new game with each life.
        self.games = AtariVectorEnv(
            of_game["game"],
            num_envs,
            **own,
            autoreset_mode=AutoresetMode.SAME_STEP,
            img_height=screen_size,
            img_width=screen_size,
            stack_num=frame_stack,
            noop_max=noop_max,
            life_loss_info=True,
            reward_clipping=False,
        )
        self.scores = np.zeros(num_envs)
        self.frames = np.zeros(num_envs, dtype=np.int64)
        super().__init__(
            num_envs, self.games.single_observation_space, self.games.single_action_space
        )

    def reset(self) -> Any:
        """Begin new games, and return their pictures."""
        seeds = [-1 if seed is None else seed % 2**31 for seed in self._seeds]
        pictures, info = self.games.reset(seed=np.asarray(seeds))
        self.scores[:] = 0
        self.frames = info["episode_frame_number"]
        self._reset_seeds()
        return pictures

    def step_async(self, actions: np.ndarray) -> None:
        """Begin a step."""
        self.games.send(actions)

    def step_wait(self) -> Any:
        """Return what the step brought."""
        pictures, rewards, terminations, truncations, info = self.games.recv()
        self.scores += rewards
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        dones = terminations | truncations
        for i in np.flatnonzero(dones):
            infos[i]["TimeLimit.truncated"] = bool(truncations[i] and not terminations[i])
            # With the loss of a life a game goes on, and ``final_obs`` has an older picture.
            over = info["episode_frame_number"][i] < self.frames[i]
            infos[i]["terminal_observation"] = info["final_obs"][i] if over else pictures[i]
            if over:
                played = int(self.frames[i]) + self.frame_skip
                infos[i]["episode"] = {"r": float(self.scores[i]), "l": played}
                self.scores[i] = 0
        self.frames = info["episode_frame_number"]
        return pictures, np.sign(rewards).astype(np.float32), dones, infos

    def close(self) -> None:
        """End the games' threads."""
        self.games.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute, the same for every game."""
        return [getattr(self.games, attr_name) for _ in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Return that no game has a wrapper."""
        return [False for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refuse: the games are not objects of Python."""
        raise NotImplementedError(attr_name)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> Any:
        """Refuse: the games are not objects of Python."""
        raise NotImplementedError(method_name)
