"""Call several groups at the same time."""

from __future__ import annotations

from collections.abc import Iterable

from gym_server.processes.worker_process import WorkerProcess
from gym_server.vector_envs.local_group import LocalGroup

AnyGroup = LocalGroup | WorkerProcess


def call_all(calls: Iterable[tuple[AnyGroup, str, tuple]]) -> list:
    """Start all calls and wait for all results; then raise the first error.

    Args:
        calls: a group, the name of one of its methods, and the arguments.
    """
    results = []
    begun = []
    failure: BaseException | None = None
    try:
        for group, method, arguments in calls:
            group.begin(method, *arguments)
            begun.append(group)
    except BaseException as refusal:
        failure = refusal
    for group in begun:
        # Take all results: one that is left over would be taken for the next call's.
        try:
            results.append(group.finish())
        except BaseException as refusal:
            failure = failure or refusal
    if failure is not None:
        raise failure
    return results
