"""From a request to an answer: each route has an endpoint, which reads, calls and writes."""

from __future__ import annotations

from hashlib import blake2b

from werkzeug.datastructures import MIMEAccept
from werkzeug.exceptions import MethodNotAllowed
from werkzeug.http import parse_accept_header
from werkzeug.wrappers import Request

from gym_server.api.calls import Call, Services
from gym_server.api.exactly_once import ExactlyOnce, Outcome
from gym_server.api.routing import Match, Route
from gym_server.errors import GymServerError, answer_to, body_too_large
from gym_server.protocol import answers, bodies
from gym_server.protocol.answers import Answer
from gym_server.protocol.fields import REQUEST, RequestId, read
from gym_server.protocol.safetensors import TENSORS

# As much as the answers that are kept beside it; a digest of it takes 40 us.
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
        sends_tensors = route.tensor_body and TENSORS in environ.get("CONTENT_TYPE", "")
        if route.method == "GET":
            body = _query(environ)
        else:
            body = bodies.loads_tensors(raw) if sends_tensors else bodies.loads(raw)
        wants_tensors = route.tensors and _prefers_tensors(accept, route.content_type)
        request_id = read(body, (REQUEST,))["request"] if route.once else None
        instance_id = match.variables.get("instance_id")

        def perform() -> Outcome:
            try:
                fields = read(body, route.fields)
                call = Call(
                    self._services,
                    match.variables,
                    body,
                    fields,
                    wants_tensors,
                    match.path,
                    accept,
                )
                result = route.handler(call)
                answer = answers.answer(result, request_id)
                return Outcome(answer, True, instance_id or _created(result))
            except BaseException as error:
                # What an environment raises must not pass by the answer that is stored.
                did_nothing = isinstance(error, GymServerError) and error.did_nothing
                return Outcome(failure(error, request_id), not did_nothing, instance_id)

        if request_id is None:
            return perform().answer
        # A request that ends an instance is kept with those that create one, so that it is never
        # refused because the instance has seen too many keys.
        moved_id = None if route.ends_instance else instance_id
        content = (match.path, _fingerprint(raw), sends_tensors, wants_tensors)
        try:
            return self._exactly_once.answer(request_id, moved_id, content, perform)
        except Exception as error:
            return failure(error, request_id)

    def _body(self, environ: dict) -> bytes:
        length = int(environ.get("CONTENT_LENGTH") or 0)
        if length > self._max_body_bytes:
            raise body_too_large()
        return environ["wsgi.input"].read(length)


def failure(error: BaseException, request_id: RequestId | None) -> Answer:
    """Return the answer that tells of an error."""
    status, body = answer_to(error)
    answer = answers.answer(body, request_id, status)
    if isinstance(error, GymServerError):
        answer = answer._replace(headers=error.headers)
    elif isinstance(error, MethodNotAllowed):
        answer = answer._replace(headers=(("Allow", ", ".join(sorted(error.valid_methods))),))
    return answer


def kept_bytes(content: tuple | None, answer: Answer | None) -> int:
    """Tell how much is kept of a request, as its endpoint describes it, and of its answer."""
    return 0 if content is None or answer is None else len(content[1]) + len(answer.body)


def _query(environ: dict) -> dict[str, str | list[str]]:
    """Return a query's fields; one that was given several times is a list, which no field takes."""
    lists = Request(environ).args.lists()
    return {name: values[0] if len(values) == 1 else values for name, values in lists}


def _fingerprint(body: bytes) -> bytes:
    """Return what a repetition is known by: a digest where the body is too long to keep."""
    return body if len(body) <= _KEPT_BYTES else blake2b(body).digest()


def _created(result: object) -> str | None:
    """Return the id of the instance that a route without one in its path has created."""
    return result.get("instance_id") if isinstance(result, dict) else None


def _prefers_tensors(accept: str, content_type: str) -> bool:
    # Reading the header properly takes time in each step, and few clients write more than a name.
    if TENSORS not in accept:
        return False
    if accept == TENSORS:
        return True
    return parse_accept_header(accept, MIMEAccept).best_match([TENSORS, content_type]) == TENSORS
