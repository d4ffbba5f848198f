"""Sub-environments: how one is made, and Gymnasium's two ways to run many."""

from __future__ import annotations

import contextlib
import copy
import time
from collections.abc import Callable, Sequence
from multiprocessing.connection import wait
from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv
from gymnasium.vector.utils import create_empty_array

from gym_server import spaces
from gym_server.envs.footprint import Account
from gym_server.envs.make import load_creator, make_from_spec
from gym_server.envs.wrappers import Wrapper, wrap
from gym_server.processes import start
from gym_server.rendering.render_thread import RenderThread

# Workers that have not ended by then are ended.
_CLOSE_SECONDS = 3.0

_ERROR_SECONDS = 5.0


class SubEnv:
    """Makes one sub-environment: an environment and the wrappers around it."""

    def __init__(
        self,
        spec: EnvSpec,
        render_mode: str | None,
        kwargs: dict,
        wrappers: Sequence[Wrapper],
        renderer: RenderThread,
        account: Account | None = None,
    ) -> None:
        """Note what to make; a call makes it.

        Args:
            spec: what to make.
            render_mode: what it gets as such, or None.
            kwargs: handed to it.
            wrappers: see ``wrappers.wrap()``.
            renderer: where wrappers that draw are made.
            account: what the memory of the wrappers is charged to, for all of them at the first;
                None where it has been.
        """
        self._how = spec, render_mode, kwargs
        self._wrappers = wrappers
        self._renderer = renderer
        self._account: Account | None = account

    def __call__(self) -> gymnasium.Env:
        """Make another one."""
        account, self._account = self._account, None
        return wrap(make_from_spec(*self._how), self._wrappers, self._renderer, account)


class WorkerSubEnv(SubEnv):
    """Makes a sub-environment in a process of its own."""

    def __init__(self, sub_env: SubEnv, autoreset_mode: AutoresetMode) -> None:
        """Make what another one makes.

        Args:
            sub_env: the other.
            autoreset_mode: the sub-environment resets itself when it is NEXT_STEP.
        """
        super().__init__(*sub_env._how, sub_env._wrappers, sub_env._renderer, sub_env._account)
        self._resets_itself = autoreset_mode == AutoresetMode.NEXT_STEP

    def __getstate__(self) -> dict:
        """Leave the render thread and the account here."""
        return {**self.__dict__, "_renderer": None, "_account": None}

    def __call__(self) -> gymnasium.Env:
        """Make another one."""
        if self._renderer is None:
            start.exit_with_parent()
            load_creator(self._how[0])
            self._renderer = _ThisThread()  # type: ignore[assignment]
            return self._make()
        env = self._make()
        # Before processes are started for nothing, and cannot tell what is wrong with them.
        spaces.describe(env.observation_space)
        spaces.describe(env.action_space)
        return env

    def _make(self) -> gymnasium.Env:
        env = super().__call__()
        return gymnasium.wrappers.Autoreset(env) if self._resets_itself else env


class _ThisThread:
    """A render thread for a process that has but one."""

    def run(self, draw: Callable, *args: object) -> object:
        return draw(*args)


class SyncSubEnvs(SyncVectorEnv):
    """Sub-environments one after the other in this process; also only some of them."""

    def __init__(self, sub_env: SubEnv, num_envs: int, autoreset_mode: AutoresetMode) -> None:
        """Make all sub-environments."""
        # What it returns is encoded before it moves again.
        super().__init__([sub_env] * num_envs, copy=False, autoreset_mode=autoreset_mode)

    def step_sub_envs(self, sub_envs: np.ndarray, actions: Any) -> tuple:
        """Step some of the sub-environments.

        Args:
            sub_envs: their numbers from 0, in order.
            actions: a batch of one action for each of them.

        Returns:
            What ``step()`` returns, with one row for each of these sub-environments.
        """
        some = copy.copy(self)
        # Older Gymnasiums close the environments of one that is gone.
        some.closed = True
        some.num_envs = len(sub_envs)
        some.envs = [self.envs[sub_env] for sub_env in sub_envs]
        some._env_obs = [self._env_obs[sub_env] for sub_env in sub_envs]
        some._observations = create_empty_array(self.single_observation_space, n=len(sub_envs))
        for name in _FLAGS:
            setattr(some, name, getattr(self, name)[sub_envs])
        answer = SyncVectorEnv.step(some, actions)
        for sub_env, observation in zip(sub_envs, some._env_obs, strict=True):
            self._env_obs[sub_env] = observation
        for name in _FLAGS:
            getattr(self, name)[sub_envs] = getattr(some, name)
        return answer

    def render_sub_env(self, sub_env: int) -> object:
        """Draw one sub-environment."""
        return self.envs[sub_env].render()

    def observation_of(self, sub_env: int) -> object:
        """Return what one sub-environment was last seen to be."""
        return self._env_obs[sub_env]


# What Gymnasium keeps of each sub-environment, beside its observation.
_FLAGS = ("_rewards", "_terminations", "_truncations", "_autoreset_envs")


class AsyncSubEnvs(AsyncVectorEnv):
    """Sub-environments in a process each, which end when they are told to, or else are ended."""

    def __init__(self, sub_env: SubEnv, num_envs: int, autoreset_mode: AutoresetMode) -> None:
        """Start all processes."""
        # Observations come through the pipes: in shared memory Gymnasium has no Sequence, no
        # Graph and no half floats, and its Texts never change. Without it, its worker forgets
        # at a reset that an episode had ended, so there the sub-environments see to that
        # themselves.
        resets_itself = autoreset_mode == AutoresetMode.NEXT_STEP
        self._failed = False
        # Before Gymnasium starts them.
        start.context()
        try:
            self._with_workers(
                super().__init__,
                [WorkerSubEnv(sub_env, autoreset_mode)] * num_envs,
                shared_memory=False,
                copy=False,
                context=start.START_METHOD,
                autoreset_mode=AutoresetMode.DISABLED if resets_itself else autoreset_mode,
            )
        except BaseException:
            self.close()
            raise
        self.autoreset_mode = autoreset_mode
        self.metadata["autoreset_mode"] = autoreset_mode

    def reset(self, **how: Any) -> tuple:
        """Reset all sub-environments, or those of a mask."""
        return self._with_workers(super().reset, **how)

    def step(self, actions: Any) -> tuple:
        """Step all sub-environments."""
        return self._with_workers(super().step, actions)

    def render_sub_env(self, sub_env: int) -> object:
        """Draw one sub-environment."""
        return self._with_workers(self._render_sub_env, sub_env)

    def _render_sub_env(self, sub_env: int) -> object:
        pipe = self.parent_pipes[sub_env]
        pipe.send(("_call", ("render", (), {})))
        frame, success = pipe.recv()
        self._raise_if_errors([success])
        return frame

    def _with_workers(self, move: Callable, *args: Any, **how: Any) -> Any:
        if self._failed:
            raise RuntimeError("one of its processes ended; close it and create another")
        # When one fails, the answers of the others would be taken for those to the next call.
        self._failed = True
        try:
            answer = move(*args, **how)
        except (EOFError, OSError) as failure:
            raise RuntimeError(f"the process of {self._ended()} ended without a word") from failure
        self._failed = False
        return answer

    def _ended(self) -> str:
        sentinels = [process.sentinel for process in self.processes]
        ended = wait(sentinels, timeout=1)
        return f"sub-environment {sentinels.index(ended[0])}" if ended else "a sub-environment"

    def _raise_if_errors(self, successes: Sequence[bool]) -> None:
        if all(successes):
            return
        try:
            _, _, failure, _ = self.error_queue.get(timeout=_ERROR_SECONDS)
        except Exception:
            # Not every exception survives the way here.
            raise RuntimeError("a sub-environment failed, and could not send why") from None
        raise failure

    def kill(self) -> None:
        """End every process at once; whoever waits for one learns that it is gone."""
        for process in self.processes:
            # One that was closed meanwhile is no process any more.
            with contextlib.suppress(ValueError):
                process.kill()

    def close_extras(self, **_: Any) -> None:
        """Ask every process to end, and end those that do not."""
        for pipe in getattr(self, "parent_pipes", ()):
            # One that ended before cannot be asked.
            with contextlib.suppress(OSError, ValueError):
                pipe.send(("close", None))
        deadline = time.monotonic() + _CLOSE_SECONDS
        started = [one for one in getattr(self, "processes", ()) if one.pid is not None]
        for process in started:
            process.join(max(0.0, deadline - time.monotonic()))
            if process.is_alive():
                process.kill()
                process.join()
            process.close()
        for pipe in getattr(self, "parent_pipes", ()):
            pipe.close()
