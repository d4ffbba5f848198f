"""Vector environments made of separate sub-environments.

They form a group in this process, or one in each of several worker processes. A step of all sends
one call to each. The results are the same for any number of processes.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.spaces import Space
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from gym_server import spaces
from gym_server.envs.drawing import Drawing
from gym_server.envs.wrappers import draws_when_stepped, time_limit
from gym_server.errors import GymServerError
from gym_server.processes.cores import spread
from gym_server.processes.pool import pool
from gym_server.processes.worker_process import WorkerProcess
from gym_server.rendering.render_thread import RenderThread
from gym_server.spaces.stacking import ARRAYS, join, unstack
from gym_server.vector_envs import group_worker
from gym_server.vector_envs.group import Group, Outcome
from gym_server.vector_envs.infos import gather
from gym_server.vector_envs.sub_env import SubEnv


class SubEnvs:
    """A vector environment of sub-environments of one kind.

    Attributes:
        num_envs: the number of sub-environments.
        num_workers: how many processes run them; 0 for this process.
        autoreset_mode: when a sub-environment whose episode ended is reset.
        ended: which of them have ended and do not move until they are reset.
        moved: which rows of the last step moved; None for all.
        draws_when_stepped: whether its steps must run on the render thread.
        metadata, render_mode: as in Gymnasium.
        spec: the environment's spec, set by the function that makes it.
        time_limit: the smallest time limit of a sub-environment, or None.
        single_observation_space, single_action_space: the spaces of one sub-environment.
        observation_space, action_space: the batched spaces.
    """

    # Each has its own seed and resets, and some can step while the others wait.
    resets_each = runs_each = True

    def __init__(
        self,
        sub_env: SubEnv,
        num_envs: int,
        autoreset_mode: AutoresetMode,
        num_workers: int,
        renderer: RenderThread,
        keeps_processes: bool = False,
    ) -> None:
        """Make all sub-environments.

        Args:
            sub_env: makes a sub-environment.
            num_envs: how many to make.
            autoreset_mode: see above.
            num_workers: how many processes run them; 0 for this process.
            renderer: the process's render thread.
            keeps_processes: whether the processes may run other environments afterwards.

        Raises:
            GymServerError: ``unsupported_space``, ``not_supported``, ``environment_died``; and
                exceptions of the environment.
        """
        self.num_envs = num_envs
        self.num_workers = num_workers
        self.autoreset_mode = autoreset_mode
        self.spec: EnvSpec | None = None
        self.ended = np.zeros(num_envs, dtype=bool)
        self.moved: np.ndarray | None = None
        self._renderer = renderer
        self.drawing = Drawing(renderer)
        self._keeps_processes = keeps_processes
        self._on_end: Callable[[GymServerError], None] = lambda why: None
        self._is_closed = False
        # How many episodes each starts automatically; negative for no limit.
        self._to_begin = np.full(num_envs, -1)
        # The number of each group's first sub-environment, and at the end the number of all.
        self._bounds = _bounds(num_envs, max(1, num_workers))
        # The group in this process, or the processes of several.
        self._group: Group | None = None
        self._processes: list[WorkerProcess] = []
        if num_workers == 0:
            self._group = Group(sub_env, range(num_envs), autoreset_mode)
            self._describe(self._group.envs[0], self._group.render_mode)
            self.drawing.drawn = self.draws_when_stepped
        else:
            self._describe_one(sub_env)
            self._start(sub_env)

    # Making ---------------------------------------------------------------------------------

    def _describe_one(self, sub_env: SubEnv) -> None:
        """Make one in this process to learn its spaces, and close it."""
        one = sub_env()
        try:
            # Refuses unsupported spaces before any process starts.
            spaces.describe(one.observation_space)
            spaces.describe(one.action_space)
            self._describe(one, one.render_mode)
        finally:
            self._renderer.close(one.close, draws_when_stepped(one))
        self.draws_when_stepped = False

    def _describe(self, env: Any, render_mode: str | None) -> None:
        self.metadata = {**(env.metadata or {}), "autoreset_mode": self.autoreset_mode}
        self.render_mode = render_mode
        self.single_observation_space: Space = env.observation_space
        self.single_action_space: Space = env.action_space
        self.observation_space = batch_space(env.observation_space, self.num_envs)
        self.action_space = batch_space(env.action_space, self.num_envs)
        self.draws_when_stepped = draws_when_stepped(env)
        self.time_limit = time_limit(env)

    def _start(self, sub_env: SubEnv) -> None:
        try:
            for _ in range(self.num_workers):
                self._processes.append(pool.take(group_worker.__name__))
            pickled = _pickled(sub_env)
            _call_all(
                (process, "make", (pickled, range(first, end), self.autoreset_mode))
                for process, (first, end) in zip(
                    self._processes, pairwise(self._bounds), strict=True
                )
            )
        except GymServerError as refusal:
            self._kill_processes()
            if refusal.code in ("environment_died", "call_too_long", "too_much_memory"):
                raise
            # Making one in this process has succeeded.
            raise GymServerError(
                "not_supported",
                f"This environment cannot be made in another process: {refusal.message}",
                "use num_workers 0 to run the sub-environments in the server's process",
            ) from refusal
        except BaseException:
            self._kill_processes()
            raise
        spread(self.pids)

    # Moves ----------------------------------------------------------------------------------

    def reset(
        self,
        seed: int | Sequence[int | Sequence[int] | None] | None,
        options: dict | None,
        mask: np.ndarray | None,
        with_infos: bool = True,
    ) -> tuple[Any, dict]:
        """Start an episode in every sub-environment, or in those of a mask.

        Args:
            seed: one from which each derives its own, or one each. Each of these may also be
                several: one for now, and others for the episodes that follow.
            options: options for the environments.
            mask: booleans; None for all. With a mask, no options become ``{}``, as in Gymnasium.
            with_infos: whether infos are wanted.

        Returns:
            The observations of all sub-environments, and an info.
        """
        seeds = _seeds_of(seed, self.num_envs)
        which = np.arange(self.num_envs) if mask is None else np.flatnonzero(mask)
        own = [seeds[sub_env] for sub_env in which.tolist()]
        first = [one[0] if isinstance(one, (tuple, list)) else one for one in own]
        later = [one[1:] if isinstance(one, (tuple, list)) else None for one in own]
        if mask is not None:
            options = options or {}
        results = self._ask(
            "reset", which, lambda rows: (first[rows], later[rows], options), everywhere=True
        )
        self.ended[which] = False
        self._to_begin[which] = [-1 if seeds is None else len(seeds) for seeds in later]
        space = self.single_observation_space
        observation = join(space, [batch for batch, _ in results])
        if not with_infos:
            return observation, {}
        infos: list = [None] * self.num_envs
        told = [info for _, infos_of_group in results for info in infos_of_group]
        for sub_env, info in zip(which, told, strict=True):
            infos[sub_env] = info
        return observation, gather(infos, {}, self.num_envs)

    def step(self, which: np.ndarray | None, actions: Any, with_infos: bool = True) -> tuple:
        """Step some sub-environments.

        Args:
            which: their numbers, in increasing order; None for all.
            actions: a batch with an action for each of them.
            with_infos: whether infos are wanted.

        Returns:
            The same as Gymnasium's vector environments, with a row for each that stepped.
        """
        if which is not None and len(which) == self.num_envs:
            which = None
        resting = self.ended if which is None else self.ended[which]
        self.moved = ~resting if resting.any() else None
        space = self.single_action_space
        members = actions if isinstance(space, ARRAYS) else unstack(space, actions)
        outcomes: list[Outcome] = self._ask("step", which, lambda rows: (members[rows], with_infos))
        outcome = outcomes[0] if len(outcomes) == 1 else self._joined(outcomes)
        self._note_ends(which, outcome)
        count = len(outcome.reward)
        info = gather(outcome.infos, outcome.final, count)
        return outcome.observation, outcome.reward, outcome.terminated, outcome.truncated, info

    def _joined(self, outcomes: list[Outcome]) -> Outcome:
        final: dict[int, object] = {}
        before = 0
        for one in outcomes:
            final.update((before + row, observation) for row, observation in one.final.items())
            before += len(one.reward)
        return Outcome(
            join(self.single_observation_space, [one.observation for one in outcomes]),
            np.concatenate([one.reward for one in outcomes]),
            np.concatenate([one.terminated for one in outcomes]),
            np.concatenate([one.truncated for one in outcomes]),
            final,
            [info for one in outcomes for info in one.infos],
        )

    def _note_ends(self, which: np.ndarray | None, outcome: Outcome) -> None:
        """Note which sub-environments wait for a reset, and which start an episode themselves."""
        done = outcome.terminated | outcome.truncated
        if not done.any():
            return
        over = np.flatnonzero(done) if which is None else which[done]
        if self.autoreset_mode is AutoresetMode.DISABLED:
            self.ended[over] = True
        else:
            to_begin = self._to_begin[over]
            self.ended[over[to_begin == 0]] = True
            self._to_begin[over[to_begin > 0]] -= 1

    # Groups ---------------------------------------------------------------------------------

    def _ask(
        self,
        method: str,
        which: np.ndarray | None,
        arguments: Callable[[slice], tuple],
        everywhere: bool = False,
    ) -> list:
        """Call a method of the groups of some sub-environments, at the same time.

        Args:
            method: its name.
            which: the numbers of the sub-environments; None for all.
            arguments: returns the other arguments for a range of these sub-environments.
            everywhere: whether to call groups that have none of them, too.
        """
        if self._group is not None:
            own = None if which is None else which.tolist()
            return [getattr(self._group, method)(own, *arguments(slice(None)))]
        bounds = self._bounds if which is None else np.searchsorted(which, self._bounds).tolist()

        def calls() -> Iterator[_Call]:
            for process, (first, last), start in zip(
                self._processes, pairwise(bounds), self._bounds, strict=False
            ):
                if first < last or everywhere:
                    rows = slice(first, last)
                    own = None if which is None else (which[rows] - start).tolist()
                    yield process, method, (own, *arguments(rows))

        return _call_all(calls())

    def _ask_one(self, method: str, sub_env: int) -> Any:
        if self._group is not None:
            return getattr(self._group, method)(sub_env)
        place = int(np.searchsorted(self._bounds, sub_env, side="right")) - 1
        return self._processes[place].call(method, sub_env - self._bounds[place])

    # Looks ----------------------------------------------------------------------------------

    def draw(self, sub_env: int) -> object:
        """Draw a sub-environment."""
        if self._group is not None:
            return self.drawing.draw(self._group.render, sub_env)
        return self._ask_one("render", sub_env)

    def observed(self, sub_env: int, batch: object) -> object:
        """Return the last observation of a sub-environment."""
        return self._ask_one("observed", sub_env)

    # The end --------------------------------------------------------------------------------

    def report_end(self, on_end: Callable[[GymServerError], None]) -> None:
        """Report from now on if a process ends unexpectedly, or at once if one has."""
        self._on_end = on_end
        for process in self._processes:
            process.report_end(self._end)

    def _end(self, why: GymServerError) -> None:
        """End when one of the processes has ended."""
        if not self._is_closed:
            self._is_closed = True
            self._kill_processes(why)
            self._on_end(why)

    @property
    def pids(self) -> list[int]:
        """The numbers of its processes."""
        return [process.pid for process in self._processes]

    def close(self) -> None:
        """Close all sub-environments, and release or end their processes."""
        if self._is_closed:
            return
        self._is_closed = True
        if self._group is not None:
            self.drawing.close(self._group.close)
        for process in self._processes:
            process.release()
        try:
            _call_all((process, "close", ()) for process in self._processes)
        except BaseException:
            self._kill_processes()
            raise
        for process in self._processes:
            if self._keeps_processes:
                pool.put(process)
            else:
                process.kill()

    def _kill_processes(self, why: GymServerError | None = None) -> None:
        for process in self._processes:
            process.kill(why)


# A process, the name of a method of its group, and the arguments.
_Call = tuple[WorkerProcess, str, tuple]


def _call_all(calls: Iterable[_Call]) -> list:
    """Start all calls and wait for all results; then raise the first error."""
    results = []
    begun = []
    failure: BaseException | None = None
    try:
        for process, method, arguments in calls:
            process.begin(method, *arguments)
            begun.append(process)
    except BaseException as refusal:
        failure = refusal
    for process in begun:
        # Take all results: one that is left over would be taken for the next call's.
        try:
            results.append(process.finish())
        except BaseException as refusal:
            failure = failure or refusal
    if failure is not None:
        raise failure
    return results


def _pickled(sub_env: SubEnv) -> bytes:
    try:
        return pickle.dumps(sub_env, 5)
    except Exception as failure:
        raise GymServerError("not_supported", str(failure)) from failure


def _bounds(num_envs: int, groups: int) -> list[int]:
    """Return where groups of nearly equal size start, and at the end the total."""
    return [num_envs * group // groups for group in range(groups + 1)]


def _seeds_of(seed: Any, num_envs: int) -> Sequence[int | Sequence[int] | None]:
    if seed is None:
        return [None] * num_envs
    if isinstance(seed, int):
        return [seed + sub_env for sub_env in range(num_envs)]
    return list(seed)
