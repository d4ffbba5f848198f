"""What a route's handler is given: the parsed request, and what the routes work on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from gym_server.api.routing import Route
from gym_server.api.watch_keys import WatchKeys
from gym_server.instances.instance import Instance
from gym_server.manager.instance_manager import InstanceManager
from gym_server.manager.limits import Watchers
from gym_server.manager.rollouts import Rollouts
from gym_server.monitoring.monitor_directory import MonitorRoot
from gym_server.protocol.answers import JSON_FORM, AnswerForm

# Where the server puts a function in WSGI's environment that tells whether a client still waits.
IS_CONNECTED = "gym_server.is_connected"


@dataclass(frozen=True)
class Services:
    """What the routes work on.

    Attributes:
        instances: the environments.
        rollouts: plays whole episodes.
        monitor_root: where monitors may write.
        stop: asks the server to stop once the requests under way are answered.
        watchers: counts those who wait for a frame.
        routes: all routes, which one of them describes.
        watch_keys: the keys that open watch pages; None where no page asks for one.
    """

    instances: InstanceManager
    rollouts: Rollouts
    monitor_root: MonitorRoot
    stop: Callable[[], None]
    watchers: Watchers
    routes: Sequence[Route]
    watch_keys: WatchKeys | None = None


class Call(NamedTuple):
    """A request, parsed.

    Attributes:
        services: what to work on.
        path: the variable parts of the URL.
        body: the request's JSON object, or the query of a GET.
        fields: the values of the fields that the route declares; None for absent ones.
        form: how the client wants tensors, where the route has them.
        url: the path as it was asked for.
        accept: what the client says it takes.
        is_connected: whether the client still waits for its answer.
    """

    services: Services
    path: dict[str, str]
    body: dict
    fields: dict
    form: AnswerForm = JSON_FORM
    url: str = ""
    accept: str = ""
    is_connected: Callable[[], bool] = lambda: True

    @property
    def instance(self) -> Instance:
        """The instance that the URL names."""
        return self.services.instances.get(self.path["instance_id"])

    @property
    def wanted_form(self) -> AnswerForm:
        """What the client wants of the answer, on a route that has the field ``info``."""
        form = self.form
        infos = self.fields["info"] is not False
        finals = self.fields.get("final_obs") is not False
        if infos and finals:
            return form
        return AnswerForm(form.tensors, form.by_column, infos, finals)
