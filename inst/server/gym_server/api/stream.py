"""Steps and resets by a WebSocket: one thread reads a message, takes the step and answers.

A message is done once: its number is kept with the stream's key in the table of the idempotency
keys of HTTP requests. So what was asked by a stream that broke can be asked again by another
stream, or by HTTP: a POST with a message is answered, too.
"""

from __future__ import annotations

import contextlib
import socket
from functools import partial

import numpy as np

from gym_server.api import env_routes
from gym_server.api.calls import Call
from gym_server.api.exactly_once import kept_body
from gym_server.api.stream_layout import (
    ANSWER_HEAD,
    ARRAYS,
    JSON_BODY,
    MASKED,
    NO_FINALS,
    NO_INFO,
    REAL_TIME,
    REQUEST_HEAD,
    RESET,
    STEP,
    TENSOR_BODY,
    malformed_message,
)
from gym_server.api.websocket import (
    GOING_AWAY,
    TAKEN_OVER,
    UNSUPPORTED,
    ProtocolError,
    WebSocket,
)
from gym_server.errors import GymServerError
from gym_server.protocol import bodies
from gym_server.protocol.answers import AnswerForm, dumps, failure, response_to
from gym_server.protocol.fields import RequestId, read
from gym_server.response import JSON, Response

# An answer to a stream's message, as it is stored for a repetition. A request by HTTP with the same
# key and number gets it, too.
MESSAGE = "application/x-gym-message"

_ROUTES = {
    STEP: env_routes.bp.routes["envs.env_step"],
    RESET: env_routes.bp.routes["envs.env_reset"],
}

_LARGEST_NUMBER = 2.0**53


class Stream:
    """Answers the messages of one client about one instance, by a WebSocket or one by one."""

    def __init__(self, call: Call, key: str, by_column: bool, as_float64: bool) -> None:
        """Prepare the stream.

        Args:
            call: the request that opens it.
            key: the key of its messages.
            by_column: whether arrays in answers are transposed, see ``COLUMN_TENSORS``.
            as_float64: whether all numbers in answers are float64, if it can represent them.
        """
        self._services = call.services
        self._instance = call.instance
        self._instance_id = self._instance.instance_id
        self._key = key
        self._by_column = by_column
        self._layout = call.services.streams.layout(self._instance, by_column, as_float64)
        self._was_taken_over = False

    def serve(self, client: socket.socket, rest: bytes) -> None:
        """Answer until the client leaves, breaks the protocol or another stream is opened."""
        streams = self._services.streams
        connection = WebSocket(client, rest, streams.most_bytes)
        try:
            with streams.added(self._instance_id, partial(self._end, client)):
                connection.send_text(self._layout.first_message())
                while not self._was_taken_over and (message := connection.receive()) is not None:
                    connection.send(self._answer(message))
            if self._was_taken_over:
                connection.close(TAKEN_OVER, "another stream to this environment was opened")
            else:
                connection.close(GOING_AWAY, "the stream has ended")
        except ProtocolError as error:
            connection.close(error.code, str(error))

    def _end(self, client: socket.socket) -> None:
        """End it because of another stream, after the answer to the message in progress."""
        self._was_taken_over = True
        with contextlib.suppress(OSError):
            client.shutdown(socket.SHUT_RD)

    def layout(self) -> Response:
        """Return the layout of messages, as the first message says it."""
        return Response(200, self._layout.first_message())

    def _answer(self, message: bytes) -> bytes:
        """Return the answer to a message, as a message."""
        response, number = self.respond(message)
        if response.content_type == MESSAGE:
            return response.body
        if response.content_type == JSON:
            head = ANSWER_HEAD.pack(JSON_BODY, response.status, 0, number)
            return head + self._layout.padded(response.body)
        return ANSWER_HEAD.pack(TENSOR_BODY, response.status, 0, number) + response.body

    def respond(self, message: bytes) -> tuple[Response, float]:
        """Do what a message asks for; return the response in HTTP's words, and the number.

        Raises:
            ProtocolError: it is no message.
        """
        if len(message) < REQUEST_HEAD.size:
            raise ProtocolError(UNSUPPORTED, f"a message has at least {REQUEST_HEAD.size} bytes")
        what, form, flags, number = REQUEST_HEAD.unpack_from(message)
        if not 0 <= number <= _LARGEST_NUMBER or number % 1:
            raise ProtocolError(UNSUPPORTED, "the number of a message is an integer from 0 to 2^53")
        request_id = RequestId(self._key, int(number))
        perform = partial(self._perform, what, form, flags, number, message[REQUEST_HEAD.size :])
        asked = kept_body(message)
        try:
            response = self._services.streams.exactly_once.respond(
                request_id, self._instance_id, asked, len(asked), perform
            )
        except Exception as error:
            response = failure(error)
        return response, number

    def _perform(
        self, what: int, form: int, flags: int, number: float, data: bytes
    ) -> tuple[Response, bool]:
        try:
            if what not in _ROUTES or form not in (ARRAYS, JSON_BODY, TENSOR_BODY):
                raise malformed_message(f"there is no request {what} in form {form}")
            if what == STEP and form == ARRAYS:
                result = self._step(flags, data)
            else:
                result = self._request(what, form, flags, data)
            arrays = self._layout.arrays(result)
            if arrays is None:
                return response_to(result, None), True
            info = dumps({"info": result["info"]}) if result["info"] else b""
            head = ANSWER_HEAD.pack(ARRAYS, 200, len(info), number)
            return Response(200, head + arrays + info, MESSAGE), True
        except BaseException as error:
            # Even SystemExit and the like, which environments may raise.
            did_nothing = isinstance(error, GymServerError) and error.did_nothing
            return failure(error), not did_nothing

    def _step(self, flags: int, data: bytes) -> dict:
        """Take the step of a message of arrays."""
        mask = None
        rows = num_envs = self._layout.num_envs
        if flags & MASKED:
            if num_envs is None or len(data) < num_envs:
                raise malformed_message("it lacks the mask of the sub-environments")
            mask = np.frombuffer(data, np.uint8, num_envs) != 0
            rows = int(mask.sum())
            data = data[num_envs + -num_envs % 8 :]
        layout = self._layout.action(rows)
        if layout is None:
            raise malformed_message("the size of actions varies, so they travel as JSON")
        return self._instance.step(
            layout.read(data), self._answer_form(flags), mask, bool(flags & REAL_TIME)
        )

    def _request(self, what: int, form: int, flags: int, data: bytes) -> dict:
        """Do what a message asks for in the words of an HTTP request."""
        route = _ROUTES[what]
        if form == TENSOR_BODY:
            if not route.tensor_body:
                raise malformed_message("a reset has no tensors")
            body = bodies.loads_tensors(data, [field.name for field in route.fields])
        else:
            body = bodies.loads(data)
        fields = read(body, route.fields)
        path = {"instance_id": self._instance_id}
        form_wanted = self._answer_form(flags)
        result = route.handler(Call(self._services, path, body, fields, form_wanted))
        assert isinstance(result, dict)
        return result

    def _answer_form(self, flags: int) -> AnswerForm:
        return AnswerForm(True, self._by_column, not flags & NO_INFO, not flags & NO_FINALS)
