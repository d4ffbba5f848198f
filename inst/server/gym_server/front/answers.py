"""The few answers that the front gives itself. Each ends its connection."""

from __future__ import annotations

import json
import re
from http import HTTPStatus
from pathlib import Path

# The same as in the answers of a user's server.
_DOCUMENTATION = "https://github.com/openai/gym-http-api#api-specification"

# The scripts and colours of the watch page. They hold nothing of a user, and the browser asks for
# them without the page's key.
_PAGE = Path(__file__).parent.parent / "viewing" / "page"
_PAGE_FILE = re.compile(r"/v1/envs/[^/]+/watch/([a-z]+\.(css|js))/?")
_TYPES = {"css": "text/css", "js": "text/javascript"}


def unauthorized() -> bytes:
    """Refuse a request that shows neither the token of a user nor the key of a running server."""
    return _refusal(
        401,
        "unauthorized",
        "The token is not this server's, or the link of a watch page has expired",
        "send the header 'Authorization: Bearer' with your token; R's env_watch() makes a new link",
    )


def malformed(reason: str) -> bytes:
    """Refuse bytes that are not the head of a request."""
    message = f"The request cannot be read: {reason}"
    return _refusal(400, "malformed_json", message, "send requests of HTTP/1.1")


def too_many_connections(most: int) -> bytes:
    """Refuse one more connection to a server that takes none."""
    return _refusal(
        429,
        "too_many_connections",
        f"Your server is busy, and {most} connections already wait for it",
        "wait until its calls have ended, or close some connections",
    )


def unavailable() -> bytes:
    """Report that the user's server did not start, or that the front is stopping."""
    return _refusal(
        503,
        "server_unavailable",
        "Your server could not be started, or this one is stopping",
        "try again; its log has the reason",
    )


def page_file(path: str) -> bytes | None:
    """Return the response with a file of the watch page; None if the path is not of one."""
    asked = _PAGE_FILE.fullmatch(path)
    if asked is None or not (_PAGE / asked[1]).is_file():
        return None
    body = (_PAGE / asked[1]).read_bytes()
    return _response(200, f"{_TYPES[asked[2]]}; charset=utf-8", body)


def _refusal(status: int, code: str, message: str, hint: str) -> bytes:
    """Return an error as a user's server would send it."""
    body = {"message": message, "code": code, "hint": hint, "documentation_url": _DOCUMENTATION}
    extra = ['WWW-Authenticate: Bearer realm="gym_server"'] if status == 401 else []
    return _response(status, "application/json", json.dumps(body).encode(), *extra)


def _response(status: int, content_type: str, body: bytes, *extra: str) -> bytes:
    lines = [
        f"HTTP/1.1 {status} {HTTPStatus(status).phrase}",
        f"Content-Type: {content_type}",
        f"Content-Length: {len(body)}",
        "Connection: close",
        "Cache-Control: no-store",
        "X-Content-Type-Options: nosniff",
        *extra,
    ]
    return "\r\n".join([*lines, "", ""]).encode() + body
