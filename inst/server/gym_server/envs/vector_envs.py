"""Making a sub-environment, and Gymnasium's two ways to run many."""

from __future__ import annotations

import contextlib
import copy
import time
from collections.abc import Callable, Iterable, Sequence
from multiprocessing.connection import wait
from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv
from gymnasium.vector.utils import create_empty_array

from gym_server import spaces
from gym_server.envs.config import Wrapper
from gym_server.envs.make import load_creator, make_from_spec
from gym_server.envs.memory_reservation import MemoryReservation
from gym_server.envs.wrappers import wrap
from gym_server.processes import start
from gym_server.rendering.render_thread import RenderThread

# Processes that have not exited by then are killed.
_CLOSE_SECONDS = 3.0

# How long the error of a process that failed may take to arrive.
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
        memory: MemoryReservation | None = None,
    ) -> None:
        """Keep the arguments; each call makes one.

        Args:
            spec: of the environment.
            render_mode: handed to it, or None.
            kwargs: handed to it.
            wrappers: see ``wrappers.wrap()``.
            renderer: where wrappers that draw are made.
            memory: reserves the memory of the wrappers for all sub-environments when the first one
                is made; None where it has been reserved.
        """
        self._make_args = spec, render_mode, kwargs
        self._wrappers = wrappers
        self._renderer = renderer
        self._memory = memory

    def __call__(self) -> gymnasium.Env:
        """Make another one."""
        memory, self._memory = self._memory, None
        return wrap(make_from_spec(*self._make_args), self._wrappers, self._renderer, memory)


class WorkerSubEnv(SubEnv):
    """Makes a sub-environment in a process of its own."""

    def __init__(self, sub_env: SubEnv, autoreset_mode: AutoresetMode) -> None:
        """Make what another ``SubEnv`` makes.

        Args:
            sub_env: the other one.
            autoreset_mode: with NEXT_STEP the sub-environment resets itself.
        """
        super().__init__(*sub_env._make_args, sub_env._wrappers, sub_env._renderer, sub_env._memory)
        self._resets_itself = autoreset_mode == AutoresetMode.NEXT_STEP

    def __getstate__(self) -> dict:
        """Leave out the render thread and the reservation, which stay in the server's process."""
        return {**self.__dict__, "_renderer": None, "_memory": None}

    def __call__(self) -> gymnasium.Env:
        """Make another one."""
        if self._renderer is None:
            start.exit_with_parent()
            load_creator(self._make_args[0])
            self._renderer = _ThisThread()
            return self._make()
        env = self._make()
        # Refuses an unsupported space here, before any process starts.
        spaces.describe(env.observation_space)
        spaces.describe(env.action_space)
        return env

    def _make(self) -> gymnasium.Env:
        env = super().__call__()
        return gymnasium.wrappers.Autoreset(env) if self._resets_itself else env


class _ThisThread:
    """Stands for the render thread in a process with a single thread.

    It has the one method that wrappers call.
    """

    def run(self, draw: Callable, *args: object) -> object:
        return draw(*args)


class SyncSubEnvs(SyncVectorEnv):
    """Sub-environments one after the other in this process; also only some of them."""

    def __init__(self, sub_env: SubEnv, num_envs: int, autoreset_mode: AutoresetMode) -> None:
        """Make all sub-environments."""
        # No copies: what a step returns is encoded before the next step.
        super().__init__([sub_env] * num_envs, copy=False, autoreset_mode=autoreset_mode)

    def step_sub_envs(self, which: np.ndarray, actions: Any) -> tuple:
        """Step some of the sub-environments.

        Args:
            which: their numbers from 0, in order.
            actions: a batch of one action for each of them.

        Returns:
            What ``step()`` returns, with one row for each of these sub-environments.
        """
        some = copy.copy(self)
        # Older Gymnasiums close the environments when the copy is collected, unless it is closed.
        some.closed = True
        some.num_envs = len(which)
        some.envs = [self.envs[sub_env] for sub_env in which]
        some._env_obs = [self._env_obs[sub_env] for sub_env in which]
        some._observations = create_empty_array(self.single_observation_space, n=len(which))
        for name in _FLAGS:
            setattr(some, name, getattr(self, name)[which])
        answer = SyncVectorEnv.step(some, actions)
        for sub_env, observation in zip(which, some._env_obs, strict=True):
            self._env_obs[sub_env] = observation
        for name in _FLAGS:
            getattr(self, name)[which] = getattr(some, name)
        return answer

    def render_sub_env(self, sub_env: int) -> object:
        """Draw one sub-environment."""
        return self.envs[sub_env].render()

    def observation_of(self, sub_env: int) -> object:
        """Return the last observation of one sub-environment."""
        return self._env_obs[sub_env]


# The arrays that Gymnasium keeps with an entry for each sub-environment, beside the observations.
_FLAGS = ("_rewards", "_terminations", "_truncations", "_autoreset_envs")


class AsyncSubEnvs(AsyncVectorEnv):
    """Sub-environments in a process each, killed when they do not exit as they are asked to."""

    def __init__(self, sub_env: SubEnv, num_envs: int, autoreset_mode: AutoresetMode) -> None:
        """Start all processes."""
        # Observations come through the pipes, because Gymnasium's shared memory takes no Sequence,
        # no Graph and no half floats, and its Texts never change. But Gymnasium's worker without
        # shared memory forgets at a reset that an episode had ended. So with NEXT_STEP each
        # sub-environment resets itself, and Gymnasium's worker does not.
        resets_itself = autoreset_mode == AutoresetMode.NEXT_STEP
        self._failed = False
        # Prepares the fork server before Gymnasium starts it.
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

    def reset(self, **arguments: Any) -> tuple:
        """Reset all sub-environments, or those of a mask."""
        result: tuple = self._with_workers(super().reset, **arguments)
        return result

    def step(self, actions: Any) -> tuple:
        """Step all sub-environments."""
        result: tuple = self._with_workers(super().step, actions)
        return result

    def render_sub_env(self, sub_env: int) -> object:
        """Draw one sub-environment."""
        return self._with_workers(self._render_sub_env, sub_env)

    def _render_sub_env(self, sub_env: int) -> object:
        pipe = self.parent_pipes[sub_env]
        pipe.send(("_call", ("render", (), {})))
        frame, success = pipe.recv()
        self._raise_if_errors([success])
        return frame

    def _with_workers(self, method: Callable, *args: Any, **kwargs: Any) -> Any:
        if self._failed:
            raise RuntimeError("one of its processes ended; close it and create another")
        # After a failure it stays failed: the results of the other processes are still in their
        # pipes, and would be taken for the results of the next call.
        self._failed = True
        try:
            result = method(*args, **kwargs)
        except (EOFError, OSError) as failure:
            raise RuntimeError(f"the process of {self._ended()} ended without a word") from failure
        self._failed = False
        return result

    def _ended(self) -> str:
        sentinels: list[Any] = [process.sentinel for process in self.processes]
        ended = wait(sentinels, timeout=1)
        return f"sub-environment {sentinels.index(ended[0])}" if ended else "a sub-environment"

    def _raise_if_errors(self, successes: Iterable[bool]) -> None:
        if all(successes):
            return
        try:
            _, _, failure, _ = self.error_queue.get(timeout=_ERROR_SECONDS)
        except Exception:
            # Not every exception can be sent: some cannot be pickled or read again.
            raise RuntimeError("a sub-environment failed, and could not send why") from None
        raise failure

    def kill(self) -> None:
        """End every process at once; a call that waits for one of them fails."""
        for process in self.processes:
            # It is closed already.
            with contextlib.suppress(ValueError):
                process.kill()

    # The type ignored: Gymnasium calls it with names, all of which fit.
    def close_extras(self, **_: Any) -> None:  # type: ignore[override]
        """Ask every process to exit, and kill those that do not."""
        for pipe in getattr(self, "parent_pipes", ()):
            # It has ended already.
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
