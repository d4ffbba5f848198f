"""What a route's handler gets: the parsed request, and the services."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

from gym_server.api.open_streams import OpenStreams
from gym_server.api.watch_keys import WatchKeys
from gym_server.instances.instance import Instance
from gym_server.manager.instance_manager import InstanceManager
from gym_server.manager.rollouts import Rollouts
from gym_server.monitoring.monitor_directory import MonitorRoot
from gym_server.protocol.answers import HTML, JSON_FORM, AnswerForm


@dataclass(frozen=True)
class Services:
    """The services that the routes use.

    Attributes:
        instances: the environments.
        rollouts: plays whole episodes.
        monitor_root: where monitors may write.
        stop: asks the server to stop after answering the requests in progress.
        streams: steps and resets by WebSockets.
        watch_keys: the keys that open watch pages; None if pages need no key.
    """

    instances: InstanceManager
    rollouts: Rollouts
    monitor_root: MonitorRoot
    stop: Callable[[], None]
    streams: OpenStreams
    watch_keys: WatchKeys | None = None


class Call(NamedTuple):
    """A parsed request.

    Attributes:
        services: the services.
        path: the variable parts of the URL.
        body: the JSON object of the request, or the query of a GET or of a route that reads bytes.
        fields: the values of the route's fields; None for missing ones.
        form: the format of tensors that the client wants, if the route supports them.
        is_connected: returns whether the client still waits for a response.
        environ: the request's head, as a WSGI environ.
        raw: the bytes of the body, on a route that reads them itself.
    """

    services: Services
    path: dict[str, str]
    body: dict
    fields: dict
    form: AnswerForm = JSON_FORM
    is_connected: Callable[[], bool] = lambda: True
    environ: Mapping[str, Any] = MappingProxyType({})
    raw: bytes = b""

    @property
    def instance(self) -> Instance:
        """The instance that the URL names."""
        return self.services.instances.get(self.path["instance_id"])

    @property
    def wants_html(self) -> bool:
        """Whether a browser asks, for people."""
        return HTML in self.environ.get("HTTP_ACCEPT", "")

    @property
    def wanted_form(self) -> AnswerForm:
        """The response that the client wants, on a route with the field ``info``."""
        form = self.form
        infos = self.fields["info"] is not False
        finals = self.fields.get("final_obs") is not False
        if infos and finals:
            return form
        return AnswerForm(form.tensors, form.by_column, infos, finals)
