"""From request to response: each route has an endpoint that reads, calls and writes."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial

from werkzeug.datastructures import MIMEAccept
from werkzeug.http import parse_accept_header
from werkzeug.wrappers import Request

from gym_server.api.calls import Call, Services
from gym_server.api.exactly_once import ExactlyOnce, kept_body
from gym_server.api.routing import Match
from gym_server.errors import GymServerError
from gym_server.protocol import bodies
from gym_server.protocol.answers import JSON_FORM, AnswerForm, failure, response_to
from gym_server.protocol.fields import REQUEST, RequestId, read
from gym_server.protocol.safetensors import COLUMN_TENSORS, TENSORS
from gym_server.response import Response


class Endpoint:
    """Answers the requests with one head."""

    def __init__(
        self, environ: dict, match: Match, services: Services, exactly_once: ExactlyOnce
    ) -> None:
        """Prepare to answer.

        Args:
            environ: the head, as a WSGI environ.
            match: its route and path.
            services: the services for the route's handler.
            exactly_once: the responses to requests with an idempotency key.
        """
        self._route = route = match.route
        self._environ = environ
        self._match = match
        self._services = services
        self._exactly_once = exactly_once
        # Read the idempotency key first, because errors in other fields echo it.
        self._fields = (REQUEST, *route.fields) if route.once else route.fields
        self._is_tensors = route.tensor_body and TENSORS in environ["CONTENT_TYPE"]
        self._read: Callable[[bytes], dict] = bodies.loads
        if route.method == "GET" or route.raw_body:
            self._read = partial(_query, environ)
        elif self._is_tensors:
            names = frozenset(field.name for field in self._fields)
            self._read = partial(bodies.loads_tensors, names=names)
        self._form = JSON_FORM
        if route.tensors:
            self._form = _wanted_form(environ.get("HTTP_ACCEPT", ""), route.content_type)
        # Requests that end an instance are stored with those that create one: the instance's own
        # end with it.
        self._used_id = None if route.ends_instance else match.variables.get("instance_id")

    def respond(self, raw: bytes, is_connected: Callable[[], bool]) -> Response:
        """Answer a request; never raise.

        Args:
            raw: its body.
            is_connected: returns whether the client still waits for the response.
        """
        fields: dict = {}
        try:
            body = self._read(raw)
            read(body, self._fields, fields)
            request_id = fields.pop("request", None)
        except Exception as error:
            return failure(error, fields.get("request"))
        match, form = self._match, self._form
        call = Call(
            self._services, match.variables, body, fields, form, is_connected, self._environ, raw
        )
        if request_id is None:
            return self._perform(call, None)[0]
        asked = kept_body(raw)
        content = match.path, asked, self._is_tensors, form
        try:
            return self._exactly_once.respond(
                request_id,
                self._used_id,
                content,
                len(asked),
                partial(self._perform, call, request_id),
            )
        except Exception as error:
            return failure(error, request_id)

    def _perform(self, call: Call, request_id: RequestId | None) -> tuple[Response, bool]:
        """Return the response, and whether doing it again could make a difference."""
        try:
            response = response_to(self._route.handler(call), request_id)
            if self._used_id is None and self._route.once:
                self._exactly_once.forget_closed()
            return response, True
        except BaseException as error:
            # Even SystemExit and the like, which environments may raise, become a response to
            # store.
            did_nothing = isinstance(error, GymServerError) and error.did_nothing
            return failure(error, request_id), not did_nothing


def _query(environ: dict, raw: bytes) -> dict[str, str | list[str]]:
    """Return a query's fields; a repeated one becomes a list, which no field accepts."""
    return dict(_parsed_query(environ["QUERY_STRING"]))


# Each message of a stream that is sent by HTTP has the query of the one before.
@lru_cache(maxsize=128)
def _parsed_query(query: str) -> dict[str, str | list[str]]:
    lists = Request({"QUERY_STRING": query}).args.lists()
    return {name: values[0] if len(values) == 1 else values for name, values in lists}


_FORMS = {
    TENSORS: AnswerForm(tensors=True),
    COLUMN_TENSORS: AnswerForm(tensors=True, by_column=True),
}


def _wanted_form(accept: str, content_type: str) -> AnswerForm:
    if TENSORS not in accept:
        return JSON_FORM
    accepted = parse_accept_header(accept, MIMEAccept)
    best = accepted.best_match([TENSORS, COLUMN_TENSORS, content_type])
    return _FORMS.get(best or "", JSON_FORM)
