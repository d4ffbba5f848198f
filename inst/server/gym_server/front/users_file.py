"""The file of users: a name and a token on each line, read again when it changes."""

from __future__ import annotations

import hmac
import logging
import re
import stat
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from gym_server import tokens
from gym_server.tokens import CannotStartError

log = logging.getLogger(__name__)

# A name is also the name of a folder and of a control group.
_NAME = re.compile("[A-Za-z0-9][A-Za-z0-9._-]{0,31}")


@dataclass(frozen=True)
class User:
    """A user, with the digest of the token. Digests have one length, so comparing takes one time.

    Attributes:
        name: the user's name.
        digest: the token's SHA-256.
    """

    name: str
    digest: bytes


class UsersFile:
    """The users in a file.

    Attributes:
        users: those of the last valid version.
    """

    def __init__(self, file: Path) -> None:
        """Read the file.

        Raises:
            CannotStartError: it cannot be used.
        """
        self._file = file
        self._version = self._seen_version()
        self.users = read_users(file)

    def _seen_version(self) -> tuple[int, ...]:
        try:
            found = self._file.stat()
        except OSError:
            return ()
        return found.st_mtime_ns, found.st_ctime_ns, found.st_size, found.st_ino

    def read_again(self) -> bool:
        """Read the file if it has changed; return whether it has other users now.

        A file that cannot be used is reported once, and the users stay as they were.
        """
        version = self._seen_version()
        if version == self._version:
            return False
        self._version = version
        before = self.users
        try:
            self.users = read_users(self._file)
        except CannotStartError as error:
            log.warning("The users stay as they were: %s", error)
        return self.users != before

    def find(self, token: bytes) -> User | None:
        """Return the user with this token; takes as long whoever it is, and if nobody has it."""
        digest = sha256(token).digest()
        found = None
        for user in self.users:
            if hmac.compare_digest(user.digest, digest):
                found = user
        return found


def read_users(file: Path) -> tuple[User, ...]:
    """Read the users from a file.

    Raises:
        CannotStartError: it cannot be used. The message names lines by their number only: a word on
            the wrong side of a line may be a token.
    """
    try:
        if file.stat().st_mode & (stat.S_IRWXG | stat.S_IRWXO):
            raise CannotStartError(
                f"other accounts may read the tokens in {file}; 'chmod 600 {file}' prevents it"
            )
        text = file.read_text("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "it is not a text in UTF-8"
        raise CannotStartError(f"the file {file} cannot be read: {reason}") from None
    users: list[User] = []
    for number, line in enumerate(text.splitlines(), 1):
        if line.strip() and not line.lstrip().startswith("#"):
            place = f"line {number} of {file}"
            user = _read_line(line, place)
            # Some file systems do not distinguish upper and lower case in the names of folders.
            if user.name.lower() in {other.name.lower() for other in users}:
                raise CannotStartError(f"{place} has a name again; give each user one line")
            if user.digest in {other.digest for other in users}:
                raise CannotStartError(f"{place} has a token again; give each user another one")
            users.append(user)
    if not users:
        raise CannotStartError(
            f"the file {file} has no user; write a name and a token on each line"
        )
    return tuple(users)


def _read_line(line: str, place: str) -> User:
    name, *others = line.split()
    if len(others) != 1:
        found = "no token" if not others else "more than a name and a token"
        raise CannotStartError(f"{place} has {found}; write a name, a space and a token")
    if _NAME.fullmatch(name) is None:
        raise CannotStartError(
            f"{place} must begin with a name of at most 32 letters, digits and '.', '_', '-'"
        )
    tokens.check(others[0], place, "; 'openssl rand -hex 16' makes one")
    return User(name, sha256(others[0].encode()).digest())
