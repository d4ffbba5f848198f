"""The routes of the watch page: the page itself, and what it shows."""

from __future__ import annotations

from pathlib import Path

from gym_server import viewing
from gym_server.api import env_fields
from gym_server.api.calls import Call
from gym_server.api.routing import INSTANCE, Callers, RouteBlueprint
from gym_server.api.watch_keys import KEY_SECONDS
from gym_server.errors import GymServerError
from gym_server.protocol.fields import Field
from gym_server.response import JSON, Response

_PAGE = Path(viewing.__file__).parent / "page"
_WATCH = INSTANCE + "watch/"

_HTML = "text/html; charset=utf-8"
_CSS = "text/css; charset=utf-8"
_JAVASCRIPT = "text/javascript; charset=utf-8"

# The page shows the current state, and its files may change with the next server.
_NO_STORE = ("Cache-Control", "no-store")
_PAGE_HEADERS = (
    _NO_STORE,
    # Nothing from other servers, and only the scripts and styles in the package's files.
    (
        "Content-Security-Policy",
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
        "img-src 'self' data:; base-uri 'none'; form-action 'none'",
    ),
    ("X-Content-Type-Options", "nosniff"),
    ("Referrer-Policy", "no-referrer"),
)


bp = RouteBlueprint("watch")


def page(url: str, status: int) -> Response:
    """Return the watch page; its script requests the state, and shows errors.

    Args:
        url: the requested path.
        status: the HTTP status.
    """
    # The page refers to its files relative to its own address, so that it works below any proxy's
    # path. That address may lack the last slash.
    here = "" if url.endswith("/") else "watch/"
    html = _read("watch.html").replace(b"{here}", here.encode())
    return Response(status, html, _HTML, _PAGE_HEADERS)


@bp.declare("GET", _WATCH, callers=Callers.WATCHERS, content_type=_HTML, refusal_page=page)
def env_watch(call: Call) -> Response:
    """Show an environment live to people."""
    try:
        _ = call.instance
        status = 200
    except GymServerError as refusal:
        # A browser gets the page anyway, which shows the error and the other environments.
        if not call.wants_html:
            raise
        status = refusal.status
    return page(call.environ["PATH_INFO"], status)


@bp.declare("POST", _WATCH + "key/")
def env_watch_key(call: Call) -> dict:
    """Make a key to an environment's page, for a browser without the token."""
    _ = call.instance
    keys = call.services.watch_keys
    if keys is None:
        return {"key": None, "seconds": None}
    return {"key": keys.make(call.path["instance_id"]), "seconds": KEY_SECONDS}


@bp.declare("GET", _WATCH + "watch.css/", callers=Callers.EVERYONE, content_type=_CSS)
def env_watch_style(call: Call) -> Response:
    """Return the watch page's style sheet."""
    return Response(200, _read("watch.css"), _CSS, headers=_PAGE_HEADERS)


@bp.declare("GET", _WATCH + "<script>.js/", callers=Callers.EVERYONE, content_type=_JAVASCRIPT)
def env_watch_script(call: Call) -> Response:
    """Return one of the watch page's scripts."""
    name = call.path["script"]
    if name not in _SCRIPTS:
        raise GymServerError("not_found", f"The watch page has no script {name}.js")
    return Response(200, _read(f"{name}.js"), _JAVASCRIPT, headers=_PAGE_HEADERS)


@bp.declare(
    "GET",
    _WATCH + "state/",
    Field("sub_env", env_fields.QUERY_INTEGER),
    Field("after", env_fields.QUERY_INTEGER),
    callers=Callers.WATCHERS,
)
def env_watch_state(call: Call) -> Response:
    """Wait for a new frame; frames are drawn only while somebody waits."""
    sub_env = call.fields["sub_env"] or 0
    call.instance.check_sub_env(sub_env)
    body = call.instance.viewer.next_frame(sub_env, call.fields["after"])
    return Response(200, body, JSON, headers=(_NO_STORE,))


@bp.declare("GET", _WATCH + "presence/", callers=Callers.WATCHERS)
def env_watch_presence(call: Call) -> dict:
    """Note that somebody still watches, without sending a frame."""
    call.instance.viewer.note_presence()
    return {"watched": True}


def _read(name: str) -> bytes:
    return (_PAGE / name).read_bytes()


_SCRIPTS = frozenset(path.stem for path in _PAGE.glob("*.js"))
