"""Play the episodes of all clients in processes of the pool.

Each process belongs to a player, a thread that waits for it. A player takes some episodes of a
request, lets its process play them for some milliseconds, and returns those that were not reached.
The oldest request comes first. After a second without work, a player returns its process to the
pool.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from gym_server import memory
from gym_server.errors import GymServerError, lacks_memory, shutting_down, too_much_memory
from gym_server.manager.rollout_request import RolloutRequest
from gym_server.processes.pool import pool
from gym_server.processes.worker_process import WorkerProcess
from gym_server.protocol.safetensors import Tensor
from gym_server.rollouts.recording import concatenated
from gym_server.rollouts.task import Task, Unit

log = logging.getLogger(__name__)

# Requests that wait or are being played. Each has a thread, and a body of up to 16 MiB.
_MOST_REQUESTS = 64

# After this many seconds without work, a process is returned to the pool.
_IDLE_SECONDS = 1.0

# How often to check that a client still waits, and how long an unwanted episode may go on before
# its process is killed.
_LOOK_SECONDS = 0.25
_UNWANTED_SECONDS = 2.0

# An episode is not played again after this many deaths of its process.
_MOST_DEATHS = 3

_WORKER = "gym_server.rollouts.worker"


@dataclass(eq=False)
class _Player:
    """A thread with a process.

    Attributes:
        process: the process; None until it is started.
        request: what it is playing, or None.
        units: the units that it is playing.
        last: the task that the process has, or None.
    """

    process: WorkerProcess | None = None
    request: RolloutRequest | None = None
    units: range = range(0)
    last: Task | None = None


class Rollouts:
    """Plays episodes for all clients.

    Attributes:
        most_processes: how many processes may play at the same time.
    """

    def __init__(self, most_processes: int) -> None:
        """Start without processes.

        Args:
            most_processes: see above.
        """
        self.most_processes = most_processes
        self._changed = threading.Condition()
        self._requests: deque[RolloutRequest] = deque()
        self._players: list[_Player] = []
        # The environment that was played last, and the duration of one of its units.
        self._last_played: tuple[str, float] | None = None
        self._stopping = False

    @property
    def is_at_work(self) -> bool:
        """Whether any process plays, or has played just now."""
        return bool(self._players)

    def describe(self, task: Task) -> dict:
        """Return the description of an environment; see ``RolloutEnv.describe()``.

        Raises:
            GymServerError: see ``play()``.
        """
        request = self._request(task, "describe", [Unit(0, ())])
        self._wait(request, lambda: True)
        if request.failed is not None:
            raise request.failed[1]
        description: dict = request.results[0][1]
        return {**description, "processes": self.most_processes}

    def play(
        self, task: Task, units: Sequence[Unit], is_wanted: Callable[[], bool]
    ) -> tuple[dict[str, Tensor], GymServerError | None]:
        """Play episodes.

        Args:
            task: what they have in common.
            units: the episodes.
            is_wanted: returns whether the client still waits for them.

        Returns:
            The tensors of the first episodes, by name; and why there are no more, or None if these
            are all, or there is no room for more.

        Raises:
            GymServerError: ``too_many_rollouts``, ``too_many_processes``, ``shutting_down``; and
                the error of the first episode.
        """
        request = self._request(task, "play", units)
        self._wait(request, is_wanted)
        if self._stopping:
            raise shutting_down()
        results, end = request.beginning()
        error = None
        if request.failed is not None and request.failed[0] == end:
            error = request.failed[1]
            if end == 0:
                raise error
        return concatenated(results), error

    def _request(self, task: Task, function: str, units: Sequence[Unit]) -> RolloutRequest:
        request = RolloutRequest(task, function, units)
        request.waiting.append(range(len(units)))
        with self._changed:
            if self._last_played is not None and self._last_played[0] == task.env_key:
                request.seconds = self._last_played[1]
            if self._stopping:
                raise shutting_down()
            if self.most_processes < 1:
                raise GymServerError(
                    "too_many_processes",
                    "Episodes are played in processes, and this server allows none",
                    "the server's option --max-processes sets the limit",
                )
            if len(self._requests) >= _MOST_REQUESTS:
                raise GymServerError(
                    "too_many_rollouts",
                    f"This server is working on {_MOST_REQUESTS} requests for rollouts, the most "
                    "it allows",
                    "send it again in a second",
                )
            self._requests.append(request)
            self._start_players()
            self._changed.notify_all()
        return request

    def _wait(self, request: RolloutRequest, is_wanted: Callable[[], bool]) -> None:
        while not request.over.wait(_LOOK_SECONDS):
            if not is_wanted():
                with self._changed:
                    request.unwanted_since = time.monotonic()
                    self._end_if_over(request)
                raise GymServerError("call_too_long", "The client stopped waiting")

    def _end_if_over(self, request: RolloutRequest) -> None:
        if request.is_over:
            request.over.set()
            if request in self._requests:
                self._requests.remove(request)

    # Players --------------------------------------------------------------------------------

    def _start_players(self) -> None:
        """Start as many players as there is work for, within the limit."""
        waiting = sum(len(units) for one in self._requests if one.has_work for units in one.waiting)
        busy = sum(player.request is not None for player in self._players)
        while len(self._players) < min(busy + waiting, self.most_processes):
            player = _Player()
            thread = threading.Thread(
                target=self._run, args=(player,), name="rollouts", daemon=True
            )
            try:
                with memory.for_threads():
                    thread.start()
            except RuntimeError as error:
                # There is no memory for its stack. If there are other players, they do the work.
                for request in [] if self._players else list(self._requests):
                    request.fail(0, too_much_memory(error))
                    self._end_if_over(request)
                return
            self._players.append(player)

    def _run(self, player: _Player) -> None:
        try:
            while self._take_turn(player):
                self._play(player)
        except Exception:
            log.exception("A bug in the server")
        try:
            self._let_process_go(player)
        finally:
            # Only now, so that a player that replaces this one finds the process in the pool.
            with self._changed:
                self._players.remove(player)
                self._start_players()

    def _let_process_go(self, player: _Player) -> None:
        with self._changed:
            process, player.process = player.process, None
        if process is not None and self._stopping:
            process.kill()
        elif process is not None:
            pool.put(process)

    def _take_turn(self, player: _Player) -> bool:
        """Find something for a player to play; return whether there is anything."""
        due = time.monotonic() + _IDLE_SECONDS
        with self._changed:
            while not self._stopping:
                for request in self._requests:
                    units = request.take(len(self._players))
                    if units is not None:
                        player.request, player.units = request, units
                        return True
                left = due - time.monotonic()
                if left <= 0:
                    return False
                self._changed.wait(left)
        return False

    def _play(self, player: _Player) -> None:
        """Let the process play some units, and store the results."""
        request, units = player.request, player.units
        assert request is not None
        began = time.monotonic()
        done: int = 0
        result: Any = None
        error: GymServerError | None = None
        try:
            done, result, error = self._call(player, request, units)
        except GymServerError as failure:
            error = failure
        except Exception as failure:
            if not lacks_memory(failure):
                raise
            error = too_much_memory(failure)
        with self._changed:
            player.request = None
            request.playing -= 1
            if done:
                request.results[units.start] = (done, result)
                if request.function == "play":
                    request.size += sum(len(tensor.data) for tensor in result.values())
                    request.seconds = (time.monotonic() - began) / done
                    self._last_played = (request.task.env_key, request.seconds)
            if error is not None:
                self._enter_error(player, request, units[done:], error)
            else:
                request.give_back(units[done:])
            self._end_if_over(request)
            self._start_players()
            self._changed.notify_all()

    def _call(
        self, player: _Player, request: RolloutRequest, units: range
    ) -> tuple[int, Any, GymServerError | None]:
        """Return how many units were played, their results, and the error that ended them."""
        process = player.process
        if process is None:
            process = pool.take(_WORKER, low_priority=True)
            process.report_end(lambda why: None)
            player.last = None
        process.progress[1] = 0
        with self._changed:
            player.process = process
            # A process that was being started when end() looked for processes.
            if self._stopping:
                raise shutting_down()
        if request.function == "describe":
            return 1, process.call("describe", request.task), None
        task = None if request.task is player.last else request.task
        player.last = None
        done, tensors, error = process.call("play", task, [request.units[unit] for unit in units])
        player.last = request.task
        return done, tensors, error

    def _enter_error(
        self, player: _Player, request: RolloutRequest, units: range, error: GymServerError
    ) -> None:
        process = player.process
        if process is None or process.is_alive:
            # The process itself reports an error of the first unit.
            request.fail(units.start, error)
            return
        # The process has ended, and the results of the units before the failed one are lost.
        player.process = None
        at_fault = units[min(process.progress[1], len(units) - 1)]
        request.deaths[at_fault] = request.deaths.get(at_fault, 0) + 1
        was_killed = error.code != "environment_died"
        if was_killed or request.deaths[at_fault] == _MOST_DEATHS:
            env_id, seed = request.task.config.env_id, request.units[at_fault].seed
            message = f"{error.message} (in {env_id}, episode of seed {seed})"
            request.fail(at_fault, GymServerError(error.code, message, error.hint))
        request.give_back(units)

    # Limits ---------------------------------------------------------------------------------

    def kill_unwanted(self) -> None:
        """Kill processes that go on playing episodes that nobody waits for."""
        before = time.monotonic() - _UNWANTED_SECONDS
        with self._changed:
            for player in self._players:
                request, process = player.request, player.process
                if request is None or process is None or request.unwanted_since is None:
                    continue
                if request.unwanted_since < before:
                    process.kill(shutting_down())

    def end(self) -> None:
        """Answer all requests with an error, and end all processes."""
        with self._changed:
            self._stopping = True
            for request in list(self._requests):
                request.fail(0, shutting_down())
                request.over.set()
            for player in self._players:
                if player.process is not None and player.request is not None:
                    player.process.kill()
            self._changed.notify_all()
