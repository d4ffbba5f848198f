"""From a request to an answer: each route has an endpoint, which reads, calls and writes."""

from __future__ import annotations

from hashlib import blake2b
from typing import Any

from werkzeug.datastructures import MIMEAccept
from werkzeug.exceptions import MethodNotAllowed
from werkzeug.http import parse_accept_header
from werkzeug.wrappers import Request

from gym_server.api.calls import IS_CONNECTED, Call, Services
from gym_server.api.exactly_once import ExactlyOnce, Outcome
from gym_server.api.routing import Match, Route
from gym_server.errors import GymServerError, answer_to, body_too_large
from gym_server.protocol import answers, bodies
from gym_server.protocol.answers import JSON, JSON_FORM, Answer, AnswerForm
from gym_server.protocol.fields import REQUEST, RequestId, read
from gym_server.protocol.safetensors import COLUMN_TENSORS, TENSORS


def _always() -> bool:
    return True


# A longer body is kept as a digest, which takes 40 us for one of this size.
_KEPT_BYTES = 2**16


class Endpoint:
    """Answers the requests to one route."""

    def __init__(
        self,
        route: Route,
        services: Services,
        exactly_once: ExactlyOnce[Answer],
        max_body_bytes: int,
    ) -> None:
        """Prepare to answer.

        Args:
            route: the route.
            services: what its handler works on.
            exactly_once: the answers to requests with an idempotency key.
            max_body_bytes: the size of the largest body.
        """
        self._route = route
        self._services = services
        self._exactly_once = exactly_once
        self._max_body_bytes = max_body_bytes

    def answer(self, environ: dict, match: Match) -> Answer:
        """Answer a request, which is given in WSGI's words; whatever goes wrong is an answer, too.

        Args:
            environ: the request.
            match: what its path says.
        """
        try:
            return self._answer(environ, match)
        except Exception as error:
            return failure(error, None)

    def _answer(self, environ: dict, match: Match) -> Answer:
        route = self._route
        raw = self._body(environ)
        accept = environ.get("HTTP_ACCEPT", "")
        read_tensors = route.tensor_body if TENSORS in environ.get("CONTENT_TYPE", "") else None
        read_body = read_tensors or bodies.loads
        body = _query(environ) if route.method == "GET" else read_body(raw)
        form = _wanted_form(accept, route.content_type) if route.tensors else JSON_FORM
        request_id = read(body, (REQUEST,))["request"] if route.once else None
        instance_id = match.variables.get("instance_id")

        def perform() -> Outcome:
            try:
                fields = read(body, route.fields)
                if route.grows:
                    self._services.instances.account.check()
                call = Call(
                    self._services,
                    match.variables,
                    body,
                    fields,
                    form,
                    match.path,
                    accept,
                    environ.get(IS_CONNECTED, _always),
                )
                result = route.handler(call)
                answer = answers.answer(result, request_id)
                return Outcome(answer, True, instance_id or _created(result))
            except BaseException as error:
                # Also SystemExit and the like, which environments may raise, become the answer that
                # is stored.
                did_nothing = isinstance(error, GymServerError) and error.did_nothing
                return Outcome(failure(error, request_id), not did_nothing, instance_id)

        if request_id is None:
            answer: Answer = perform().answer
            return answer
        # A request that ends an instance is kept with those that create one, so that it is never
        # refused because the instance has seen too many keys.
        used_id = None if route.ends_instance else instance_id
        content = (match.path, _fingerprint(raw), read_tensors is not None, form)
        try:
            return self._exactly_once.answer(request_id, used_id, content, perform)
        except Exception as error:
            return failure(error, request_id)

    def _body(self, environ: dict) -> bytes:
        length = int(environ.get("CONTENT_LENGTH") or 0)
        if length > self._max_body_bytes:
            raise body_too_large()
        body: bytes = environ["wsgi.input"].read(length)
        return body


def failure(error: BaseException, request_id: RequestId | None) -> Answer:
    """Return the answer that tells of an error."""
    status, body = answer_to(error)
    answer = answers.answer(body, request_id, status)
    if isinstance(error, GymServerError):
        answer = answer._replace(headers=error.headers)
    elif isinstance(error, MethodNotAllowed):
        allowed = ", ".join(sorted(error.valid_methods or ()))
        answer = answer._replace(headers=(("Allow", allowed),))
    return answer


def kept_bytes(content: Any, answer: Answer | None) -> int:
    """Tell how much is kept of a request, as its endpoint describes it, and of its answer."""
    return 0 if content is None or answer is None else len(content[1]) + len(answer.body)


def _query(environ: dict) -> dict[str, str | list[str]]:
    """Return a query's fields; one that was given several times is a list, which no field takes."""
    lists = Request(environ).args.lists()
    return {name: values[0] if len(values) == 1 else values for name, values in lists}


def _fingerprint(body: bytes) -> bytes:
    """Return what a repetition is compared by: a digest if the body is too long to be kept."""
    return body if len(body) <= _KEPT_BYTES else blake2b(body).digest()


def _created(result: object) -> str | None:
    """Return the id of the instance that a route without one in its path has created."""
    return result.get("instance_id") if isinstance(result, dict) else None


_ROWS = AnswerForm(tensors=True)
_COLUMNS = AnswerForm(tensors=True, by_column=True)

# Most clients send one of these, the R client the last one. To parse the header takes as long as
# many a step.
_FORMS = {
    JSON: JSON_FORM,
    TENSORS: _ROWS,
    COLUMN_TENSORS: _COLUMNS,
    f"{COLUMN_TENSORS}, {TENSORS};q=0.9": _COLUMNS,
}


def _wanted_form(accept: str, content_type: str) -> AnswerForm:
    form = _FORMS.get(accept)
    if form is not None:
        return form
    if TENSORS not in accept:
        return JSON_FORM
    accepted = parse_accept_header(accept, MIMEAccept)
    best = accepted.best_match([TENSORS, COLUMN_TENSORS, content_type])
    return _FORMS.get(best or "", JSON_FORM)
