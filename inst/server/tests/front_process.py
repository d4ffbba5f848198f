"""A real front, and its users file. For tests."""

import json
import os

from conftest import ServerProcess

TOKENS = {name: f"token-of-{name}-0123456789" for name in ("anna", "ben", "carl")}


def users_text(**tokens):
    return "".join(f"{name} {token}\n" for name, token in tokens.items())


def write_users(file, mode=0o600, **tokens):
    # Replaced at once, as editors do it: the front never reads a half.
    new = file.with_suffix(".new")
    new.write_text(users_text(**tokens))
    new.chmod(mode)
    os.replace(new, file)
    return file


class FrontProcess(ServerProcess):
    """A real front, with a server for each user who asks."""

    def __init__(self, folder, *options, tokens=TOKENS, **how):
        self.file = write_users(folder / "users", **tokens)
        runs = str(folder / "runs")
        super().__init__(
            *("--port", "0", "--users", str(self.file), "--monitor-dir", runs), *options, **how
        )

    def ask(self, token, method, path, body=None, connection=None, **headers):
        """Return the status, the answer and its headers."""
        own = connection or self.connect()
        try:
            if token is not None:
                headers["Authorization"] = f"Bearer {token}"
            own.request(method, path, body and json.dumps(body), headers)
            answer = own.getresponse()
            text = answer.read()
            is_json = answer.headers["Content-Type"] == "application/json"
            return answer.status, json.loads(text) if is_json else text, answer.headers
        finally:
            if connection is None:
                own.close()

    def pid_of(self, name):
        return self.ask(TOKENS[name], "GET", "/v1/health/")[1]["pid"]

    def make(self, name, env_id="CartPole-v1", **fields):
        """Make an environment, reset it, and return its URL."""
        status, made, _ = self.ask(TOKENS[name], "POST", "/v1/envs/", {"env_id": env_id, **fields})
        assert status == 200, made
        url = f"/v1/envs/{made['instance_id']}"
        assert self.ask(TOKENS[name], "POST", f"{url}/reset/", {"seed": 1})[0] == 200
        return url

    def steps(self, name, url, connection=None):
        """Take a step from a reset; return the status."""
        self.ask(TOKENS[name], "POST", f"{url}/reset/", {}, connection)
        return self.ask(TOKENS[name], "POST", f"{url}/step/", {"action": 0}, connection)[0]
