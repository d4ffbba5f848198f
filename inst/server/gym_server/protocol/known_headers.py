"""Bodies of one tensor whose header is known from the last ones, but for the request's number.

A client that plays sends the same header with each step; only the number of its idempotency key
grows. To parse one takes longer than the step of many an environment.
"""

from __future__ import annotations

import re
import threading
from collections.abc import Callable
from typing import NamedTuple

from gym_server.protocol.safetensors import Parts, Tensor

# How the number stands in JSON that is a text in JSON. The same number is always written alike.
_NUMBER = re.compile(rb'\\"number\\": ?(0|[1-9][0-9]{0,14})(?=[,}])')

# Each connection has a thread, and each thread remembers one header.
_LONGEST = 4096


class KnownHeader(NamedTuple):
    """A header, but for the digits of the request's number.

    Attributes:
        before: all bytes of the body that come before the digits, the header's length included.
        after: what follows them in the header, without the blanks at its end.
        begin: where the data begin.
        size: of the body.
        name: of the only tensor, which fills the data.
        tensor: its dtype and shape.
        texts: of the action.
        fields: the other fields.
        request: the idempotency key, with any number.
    """

    before: bytes
    after: bytes
    begin: int
    size: int
    name: str
    tensor: Tensor
    texts: dict[str, str]
    fields: dict
    request: dict

    def read(self, raw: bytes) -> dict | None:
        """Return the fields of a body that has this header; None where it has another."""
        if len(raw) != self.size or not raw.startswith(self.before):
            return None
        rest = raw[len(self.before) : self.begin].rstrip(b" ")
        if not rest.endswith(self.after):
            return None
        digits = rest[: len(rest) - len(self.after)]
        if not digits.isdigit() or len(digits) > 15 or (digits[0] == ord("0") and digits != b"0"):
            return None
        tensor = Tensor(self.tensor.dtype, self.tensor.shape, memoryview(raw)[self.begin :])
        request = {**self.request, "number": int(digits)}
        action = Parts({self.name: tensor}, self.texts)
        return {**self.fields, "request": request, "action": action}


class _Memory(threading.local):
    """What a thread has seen last.

    Attributes:
        seen: what stands before and after the number in the header that was parsed last.
        known: that header, once it came twice.
    """

    seen: tuple[bytes, bytes] | None = None
    known: KnownHeader | None = None


_memory = _Memory()


def read(raw: bytes, parse: Callable[[bytes], dict]) -> dict:
    """Return the fields of a body of tensors.

    Args:
        raw: the body.
        parse: does so for any header, and raises what is wrong with it.
    """
    known = _memory.known
    body = known.read(raw) if known is not None else None
    if body is None:
        body = parse(raw)
        _learn(raw, body, parse)
    return body


def _learn(raw: bytes, body: dict, parse: Callable[[bytes], dict]) -> None:
    begin = 8 + int.from_bytes(raw[:8], "little")
    header = raw[:begin]
    found = list(_NUMBER.finditer(header)) if begin <= _LONGEST else []
    if len(found) != 1:
        return
    seen = _memory.seen
    start, stop = found[0].span(1)
    _memory.seen = header[:start], header[stop:].rstrip(b" ")
    if seen == _memory.seen:
        _memory.known = _known(raw, body, (start, stop), begin, parse)


def _known(
    raw: bytes,
    body: dict,
    digits: tuple[int, int],
    begin: int,
    parse: Callable[[bytes], dict],
) -> KnownHeader | None:
    """Return the header of a body; None where more than the request's number hangs on the digits.

    Args:
        raw: the body.
        body: its fields.
        digits: where they begin and end.
        begin: where the data begin.
        parse: as for ``read()``.
    """
    action, request = body.get("action"), body.get("request")
    if not isinstance(action, Parts) or not isinstance(request, dict):
        return None
    if len(action.tensors) != 1:
        return None
    (name, sent), *_ = action.tensors.items()
    # Whether bytes are booleans must be checked each time.
    if sent.dtype == "BOOL":
        return None
    tensor = sent._replace(data=b"")
    # With another number everything else must be the same.
    start, stop = digits
    number = (int(raw[start:stop]) + 1) % 10
    header = raw[8:start] + b"%d" % number + raw[stop:begin]
    other = parse(len(header).to_bytes(8, "little") + header + raw[begin:])
    if other != {**body, "request": {**request, "number": number}}:
        return None
    fields = {name: value for name, value in body.items() if name not in ("action", "request")}
    after = raw[stop:begin].rstrip(b" ")
    return KnownHeader(
        raw[:start], after, begin, len(raw), name, tensor, action.texts, fields, request
    )
