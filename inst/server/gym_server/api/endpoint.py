"""From request to response: each route has an endpoint that reads, calls and writes."""

from __future__ import annotations

from functools import partial

from werkzeug.datastructures import MIMEAccept
from werkzeug.http import parse_accept_header
from werkzeug.wrappers import Request

from gym_server.api.calls import IS_CONNECTED, Call, Services
from gym_server.api.exactly_once import ExactlyOnce, Outcome, kept_body
from gym_server.api.failures import failure
from gym_server.api.routing import Match, Route
from gym_server.errors import GymServerError, body_too_large
from gym_server.protocol import bodies
from gym_server.protocol.answers import JSON_FORM, AnswerForm, response_to
from gym_server.protocol.fields import REQUEST, RequestId, read
from gym_server.protocol.safetensors import COLUMN_TENSORS, TENSORS
from gym_server.response import JSON, Response


def _always() -> bool:
    return True


class Endpoint:
    """Answers the requests to one route."""

    def __init__(
        self, route: Route, services: Services, exactly_once: ExactlyOnce, max_body_bytes: int
    ) -> None:
        """Prepare to answer.

        Args:
            route: the route.
            services: the services for its handler.
            exactly_once: the responses to requests with an idempotency key.
            max_body_bytes: the size of the largest body.
        """
        self._route = route
        self._services = services
        self._exactly_once = exactly_once
        self._max_body_bytes = max_body_bytes
        # Read the idempotency key first, because errors in other fields echo it.
        self._fields = (REQUEST, *route.fields) if route.once else route.fields

    def respond(self, environ: dict, match: Match) -> Response:
        """Answer a request; never raise.

        Args:
            environ: the request, as a WSGI environ.
            match: its route and path.
        """
        route = self._route
        fields: dict = {}
        try:
            length = int(environ.get("CONTENT_LENGTH") or 0)
            if length > self._max_body_bytes:
                raise body_too_large()
            raw = environ["wsgi.input"].read(length)
            tensors = route.tensor_body if TENSORS in environ.get("CONTENT_TYPE", "") else None
            body = _query(environ) if route.method == "GET" else (tensors or bodies.loads)(raw)
            read(body, self._fields, fields)
            request_id = fields.pop("request", None)
        except Exception as error:
            return failure(error, fields.get("request"))
        accept = environ.get("HTTP_ACCEPT", "")
        call = Call(
            self._services,
            match.variables,
            body,
            fields,
            (_FORMS.get(accept) or _wanted_form(accept, route.content_type))
            if route.tensors
            else JSON_FORM,
            match.path,
            accept,
            environ.get(IS_CONNECTED, _always),
            environ,
        )
        if request_id is None:
            return self._perform(call, None).response
        # Requests that end an instance are stored with those that create one, so that they are
        # never refused because the instance has too many keys.
        used_id = None if route.ends_instance else match.variables.get("instance_id")
        asked = kept_body(raw)
        content = (match.path, asked, tensors is not None, call.form)
        perform = partial(self._perform, call, request_id)
        try:
            return self._exactly_once.respond(request_id, used_id, content, len(asked), perform)
        except Exception as error:
            return failure(error, request_id)

    def _perform(self, call: Call, request_id: RequestId | None) -> Outcome:
        route, instance_id = self._route, call.path.get("instance_id")
        try:
            if route.grows:
                self._services.instances.account.check()
            result = route.handler(call)
            if instance_id is None and isinstance(result, dict):
                instance_id = result.get("instance_id")
            return Outcome(response_to(result, request_id), True, instance_id)
        except BaseException as error:
            # Even SystemExit and the like, which environments may raise, become a response to
            # store.
            did_nothing = isinstance(error, GymServerError) and error.did_nothing
            return Outcome(failure(error, request_id), not did_nothing, instance_id)


def _query(environ: dict) -> dict[str, str | list[str]]:
    """Return a query's fields; a repeated one becomes a list, which no field accepts."""
    lists = Request(environ).args.lists()
    return {name: values[0] if len(values) == 1 else values for name, values in lists}


_ROWS = AnswerForm(tensors=True)
_COLUMNS = AnswerForm(tensors=True, by_column=True)

# Most clients send one of these; the R client sends the last one. Parsing the header takes as long
# as many steps.
_FORMS = {
    JSON: JSON_FORM,
    TENSORS: _ROWS,
    COLUMN_TENSORS: _COLUMNS,
    f"{COLUMN_TENSORS}, {TENSORS};q=0.9": _COLUMNS,
}


def _wanted_form(accept: str, content_type: str) -> AnswerForm:
    if TENSORS not in accept:
        return JSON_FORM
    accepted = parse_accept_header(accept, MIMEAccept)
    best = accepted.best_match([TENSORS, COLUMN_TENSORS, content_type])
    return _FORMS.get(best or "", JSON_FORM)
