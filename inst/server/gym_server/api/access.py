"""Who may use this server; every request is checked before anything else."""

from __future__ import annotations

import contextlib
import hmac
import ipaddress
import re
import socket
from collections.abc import Collection
from dataclasses import dataclass
from urllib.parse import parse_qs

from gym_server import logs
from gym_server.api.routing import Callers, Match
from gym_server.api.watch_keys import WatchKeys
from gym_server.errors import GymServerError, malformed_request
from gym_server.json_values import brief

# A name or an address, optionally with a port.
_AUTHORITY = re.compile(r"(\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9._-]+?)\.?(?::([0-9]*))?")
_ORIGIN = re.compile("(https?)://(.*)")
_DEFAULT_PORTS = {"http": "80", "https": "443"}


@dataclass(frozen=True)
class Access:
    """Which requests a server accepts.

    Attributes:
        token: the token that every request must have; None for none.
        host: the address or name that the server listens on.
        allowed_hosts: other names of the server, NAME or NAME:PORT.
    """

    token: str | None = None
    host: str = "127.0.0.1"
    allowed_hosts: Collection[str] = ()


class Guard:
    """Accepts or refuses requests."""

    def __init__(self, access: Access, watch_keys: WatchKeys) -> None:
        """Set the rules.

        Args:
            access: which requests to accept.
            watch_keys: the keys that open a watch page without the token.
        """
        self._token = None if access.token is None else access.token.encode("latin-1")
        self._watch_keys = watch_keys
        self._names = {"localhost", access.host.lower()}
        self._origins = {split_host(name) for name in access.allowed_hosts}
        self._names |= {name for name, _ in self._origins}
        self._listens_on_loopback = is_loopback(access.host)
        self._machine_names: set[str] | None = None

    def check(self, environ: dict, match: Match | None) -> None:
        """Check whether a request is allowed.

        Args:
            environ: the request, as a WSGI environ.
            match: its route, which says who may call it; None if it has none.

        Raises:
            GymServerError: ``malformed_json`` (no Host, or several), ``foreign_host``,
                ``foreign_origin``, ``unauthorized``.
        """
        self._check_host(environ)
        if "HTTP_ORIGIN" in environ or "HTTP_SEC_FETCH_SITE" in environ:
            self._check_page(environ)
        if not self.has_token(environ):
            self._check_callers(environ, match)

    # The owner of a foreign page can make its name resolve to this machine (DNS rebinding). The
    # browser then sends that name as the host. An address cannot be redirected, so addresses are
    # accepted.
    def _check_host(self, environ: dict) -> None:
        host = environ.get("HTTP_HOST")
        if host is None:
            if environ.get("SERVER_PROTOCOL") == "HTTP/1.1":
                raise malformed_request("it has no Host header")
            return
        if "," in host:
            raise malformed_request("it has two Host headers")
        match = _AUTHORITY.fullmatch(host)
        name = match[1].lower() if match else None
        if name is None or not (_is_address(name) or self._is_ours(name)):
            raise GymServerError(
                "foreign_host",
                f"This server does not answer to the name {brief(host)}",
                "use its address, or start it with --allow-host NAME",
            )

    def _is_ours(self, name: str) -> bool:
        if name in self._names:
            return True
        if self._machine_names is None:
            # Only now, because it may have to ask the network.
            self._machine_names = _machine_names(self._listens_on_loopback)
        return name in self._machine_names

    def _check_page(self, environ: dict) -> None:
        origin = environ.get("HTTP_ORIGIN")
        if origin is not None and not self._is_own_origin(origin, environ.get("HTTP_HOST", "")):
            raise _foreign_origin(f"Pages of {brief(origin)} may not use this server")
        # Browsers send this even without an Origin. A link may be followed from anywhere.
        site = environ.get("HTTP_SEC_FETCH_SITE", "none")
        navigates = (
            environ.get("HTTP_SEC_FETCH_MODE") == "navigate" and environ["REQUEST_METHOD"] == "GET"
        )
        if site not in ("same-origin", "none") and not navigates:
            raise _foreign_origin("Pages of other sites may not use this server")

    def _is_own_origin(self, origin: str, host: str) -> bool:
        parts = _ORIGIN.fullmatch(origin)
        if parts is None:
            return False
        default = _DEFAULT_PORTS[parts[1]]
        try:
            name, port = split_host(parts[2], default)
            # A page on another port of the same machine is foreign.
            if (name, port) == split_host(host, default):
                return True
        except ValueError:
            return False
        return (name, port) in self._origins or (port == default and (name, "") in self._origins)

    def has_token(self, environ: dict) -> bool:
        """Return whether a request has the token, if there is one."""
        if self._token is None:
            return True
        # The name of the scheme is not case-sensitive.
        scheme, _, token = environ.get("HTTP_AUTHORIZATION", "").partition(" ")
        given = token.strip().encode("latin-1", "replace")
        return scheme.lower() == "bearer" and hmac.compare_digest(given, self._token)

    def _check_callers(self, environ: dict, match: Match | None) -> None:
        """Accept a request without the token if its route allows that."""
        if match is not None and match.callers is Callers.EVERYONE:
            return
        key = None
        if match is not None and match.callers is Callers.WATCHERS:
            key = parse_qs(environ.get("QUERY_STRING", "")).get("key", [""])[0]
            if self._watch_keys.opens(key, match.variables["instance_id"]):
                return
        # Once for each address, so that strangers do not fill the log.
        logs.warn_once(__name__, f"{environ.get('REMOTE_ADDR')} sent requests without a token")
        raise _unauthorized(key, "HTTP_AUTHORIZATION" in environ)


def is_loopback(host: str) -> bool:
    """Return whether an address or a name can be reached only from this machine."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def split_host(authority: str, default_port: str = "") -> tuple[str, str]:
    """Split NAME or NAME:PORT into the name, in lower case, and the port; else raise ValueError."""
    match = _AUTHORITY.fullmatch(authority)
    if match is None:
        raise ValueError(f"{authority!r} is not a host name")
    return match[1].lower(), match[2] or default_port


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name.strip("[]"))
    except ValueError:
        return False
    return True


def _machine_names(listens_on_loopback: bool) -> set[str]:
    names = {socket.gethostname().lower()}
    if not listens_on_loopback:
        with contextlib.suppress(OSError, UnicodeError):
            names.add(socket.getfqdn().lower().rstrip("."))
    return names


def _foreign_origin(message: str) -> GymServerError:
    return GymServerError(
        "foreign_origin",
        message,
        "web pages cannot use it; behind a proxy, start it with --allow-host NAME",
    )


def _unauthorized(key: str | None, has_header: bool) -> GymServerError:
    if key:
        return GymServerError(
            "unauthorized",
            "The key in this link has expired, or belongs to another environment",
            "R's env_watch() makes a new link",
        )
    if key is not None and not has_header:
        return GymServerError(
            "unauthorized",
            "This page needs a link with a key",
            "R's env_watch() makes one",
        )
    message = (
        "The token is not this server's" if has_header else "This server asks everybody for a token"
    )
    return GymServerError(
        "unauthorized", message, "send the header 'Authorization: Bearer' with the server's token"
    )
