"""Which requests are accepted, and which are refused."""

import pytest
from flask import Flask

from gym_server.api.access import Access, Guard
from gym_server.api.app import BLUEPRINTS, Config, create_app
from gym_server.api.routing import Callers, Router
from gym_server.api.watch_keys import WatchKeys
from gym_server.errors import GymServerError

TOKEN = "correct-horse-battery"
HEALTH = "/v1/health/"


def refusal(access, method="GET", path=HEALTH, keys=None, query="", **headers):
    """Return the code of the error for a request, None if it is accepted."""
    environ = {
        "REQUEST_METHOD": method,
        "PATH_INFO": path,
        "QUERY_STRING": query,
        "SERVER_PROTOCOL": "HTTP/1.1",
        **{f"HTTP_{name.upper()}": text for name, text in headers.items() if text is not None},
    }
    guard = Guard(access, keys or WatchKeys())
    match = Router(Flask("routes", static_folder=None), BLUEPRINTS).match(environ)
    try:
        guard.check(environ, match)
    except GymServerError as error:
        return error.code
    return None


@pytest.fixture
def locked():
    app = create_app(Config(access=Access(TOKEN)))
    yield app.test_client()
    app.close()


def bearer(token=TOKEN):
    return {"Authorization": f"Bearer {token}"}


# Hosts ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "host",
    ["localhost", "LOCALHOST:5000", "localhost.", "127.0.0.1:1", "192.168.1.7", "[::1]:5000"],
)
def test_this_machines_addresses_are_answered_to(host):
    assert refusal(Access(), host=host) is None


@pytest.mark.parametrize(
    "host",
    [
        "evil.example",
        "evil.example:5000",
        "localhost.evil.example",
        "127.0.0.1.evil.example",
        "127.0.0.1@evil.example",
        "evil.example#127.0.0.1",
        "",
        " ",
        "localhost/",
        "[::1",
        "0x7f.1",
        "2130706433",
        "lo\xe7alhost",
    ],
)
def test_a_name_of_somebody_elses_is_not(host):
    assert refusal(Access(), host=host) == "foreign_host"


def test_names_that_the_operator_gave_are_answered_to():
    access = Access(host="gym.lab", allowed_hosts=["gym.example.org", "other.example:8443"])
    for host in ("gym.lab:5000", "gym.example.org", "Other.Example:99", "other.example"):
        assert refusal(access, host=host) is None
    assert refusal(access, host="www.example.org") == "foreign_host"


def test_the_machines_own_name_is_answered_to(monkeypatch):
    monkeypatch.setattr("socket.gethostname", lambda: "Lab7")
    monkeypatch.setattr("socket.getfqdn", lambda: "lab7.example.org")
    assert refusal(Access(), host="lab7:5000") is None
    # This machine's network name is valid only if the server can be reached by the network.
    assert refusal(Access(), host="lab7.example.org") == "foreign_host"
    assert refusal(Access(host="0.0.0.0"), host="lab7.example.org") is None


def test_no_host_and_two_hosts_are_malformed():
    assert refusal(Access()) == "malformed_json"
    assert refusal(Access(), host="127.0.0.1,evil.example") == "malformed_json"


# Pages ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("origin", "host"),
    [
        ("http://127.0.0.1:5000", "127.0.0.1:5000"),
        ("http://LOCALHOST:5000", "localhost:5000"),
        ("https://gym.example.org", "gym.example.org"),
        ("https://gym.example.org", "gym.example.org:443"),
        # From a proxy that does not forward the Host header.
        ("https://gym.example.org", "127.0.0.1:5000"),
        ("https://other.example:8443", "127.0.0.1:5000"),
    ],
)
def test_its_own_pages_may_ask(origin, host):
    access = Access(allowed_hosts=["gym.example.org", "other.example:8443"])
    assert refusal(access, host=host, origin=origin) is None


@pytest.mark.parametrize(
    "origin",
    [
        "null",
        "",
        "https://evil.example",
        "http://127.0.0.1:8888",
        "http://127.0.0.1",
        "http://localhost:5000",
        "https://127.0.0.1:5000.evil.example",
        "http://127.0.0.1:5000@evil.example",
        "file://",
        "chrome-extension://abcdef",
        "https://gym.example.org:8888",
        "https://%%%",
        "https://",
        "http://other.example",
    ],
)
@pytest.mark.parametrize("method", ["GET", "POST", "OPTIONS"])
def test_other_pages_may_not(origin, method):
    access = Access(allowed_hosts=["gym.example.org", "other.example:8443"])
    assert refusal(access, method, host="127.0.0.1:5000", origin=origin) == "foreign_origin"


@pytest.mark.parametrize("site", ["cross-site", "same-site", "anything"])
def test_what_a_browser_calls_foreign_is_refused_but_for_links(site):
    def visit(method="GET", mode=None):
        return refusal(Access(), method, host="127.0.0.1", sec_fetch_site=site, sec_fetch_mode=mode)

    assert visit() == visit(mode="no-cors") == visit(mode="cors") == "foreign_origin"
    assert visit("POST", "navigate") == "foreign_origin"
    assert visit("GET", "navigate") is None


def test_what_a_browser_calls_its_own_passes():
    for site in ("same-origin", "none"):
        assert refusal(Access(), host="127.0.0.1", sec_fetch_site=site) is None


def test_no_answer_lets_another_page_read_it(client, create):
    url = create()
    answers = [
        client.get(HEALTH),
        client.get(f"{url}/watch/state/"),
        client.post(f"{url}/reset/", headers={"Origin": "https://evil.example"}),
        client.options(HEALTH, headers={"Origin": "http://localhost"}),
    ]
    for answer in answers:
        assert not [name for name, _ in answer.headers if name.startswith("Access-Control")]


def test_a_refusal_does_nothing(client, create):
    url = create()
    for headers in ({"Origin": "https://evil.example"}, {"Host": "evil.example"}):
        for path in ("/v1/shutdown/", f"{url}/close/", f"{url}/reset/"):
            answer = client.post(path, json={}, headers=headers)
            assert answer.status_code == 403
            assert answer.json["code"] in ("foreign_origin", "foreign_host")
    assert client.get(url).json["steps"] == 0


# Tokens --------------------------------------------------------------------------------------


def test_with_the_token_everything_is_as_ever(locked):
    answer = locked.post("/v1/envs/", json={"env_id": "CartPole-v1"}, headers=bearer())
    url = f"/v1/envs/{answer.json['instance_id']}"
    assert locked.post(f"{url}/reset/", headers={"Authorization": f"bearer  {TOKEN}"}).json
    assert locked.post(f"{url}/step/", json={"action": 0}, headers=bearer()).status_code == 200


def test_without_it_nothing_is_answered(locked, app):
    for rule in app.url_map.iter_rules():
        url = rule.rule.replace("<instance_id>", "0" * 8).replace("<x>", "0")
        if "<script>" in url or url.endswith("watch.css/"):
            continue
        for method in rule.methods - {"HEAD", "OPTIONS"}:
            for headers in ({}, bearer("wrong" * 5), {"Authorization": f"Basic {TOKEN}"}):
                answer = locked.open(url, method=method, headers=headers)
                assert (answer.status_code, answer.json["code"]) == (401, "unauthorized"), url
                assert answer.headers["WWW-Authenticate"].startswith("Bearer")
                assert TOKEN not in answer.text


def test_only_the_watch_page_is_open_to_others():
    others = {
        route.handler.__name__: route.callers for bp in BLUEPRINTS for route in bp.routes.values()
    }
    assert {name for name, callers in others.items() if callers is Callers.EVERYONE} == {
        "env_watch_style",
        "env_watch_script",
    }
    assert {name for name, callers in others.items() if callers is Callers.WATCHERS} == {
        "env_watch",
        "env_watch_state",
        "env_watch_presence",
    }


@pytest.mark.parametrize(
    "given",
    [
        "",
        "Bearer",
        "Bearer ",
        TOKEN,
        f"Bearer {TOKEN[:-1]}",
        f"Bearer {TOKEN}x",
        f"Bearer {TOKEN.upper()}",
        f"Bearer {TOKEN},Bearer {TOKEN}",
        f"Basic {TOKEN}",
        f"Bearer {TOKEN}\xff",
    ],
)
def test_what_is_not_quite_the_token_is_not_the_token(given):
    assert refusal(Access(TOKEN), host="localhost", authorization=given) == "unauthorized"


def test_a_token_is_compared_in_constant_time(monkeypatch):
    compared = []
    monkeypatch.setattr("hmac.compare_digest", lambda a, b: compared.append((a, b)) or a == b)
    assert refusal(Access(TOKEN), host="localhost", authorization=f"Bearer {TOKEN}") is None
    assert compared


# The watch page ------------------------------------------------------------------------------


@pytest.fixture
def watched(locked):
    answer = locked.post("/v1/envs/", json={"env_id": "CartPole-v1"}, headers=bearer())
    url = f"/v1/envs/{answer.json['instance_id']}"
    made = locked.post(f"{url}/watch/key/", headers=bearer()).json
    assert made["seconds"] == 600
    return url, made["key"]


def test_a_key_opens_the_watch_page_and_what_it_asks_for(locked, watched):
    url, key = watched
    for path in ("/watch", "/watch/", "/watch/state/", "/watch/state", "/watch/presence/"):
        assert locked.get(f"{url}{path}?key={key}").status_code == 200, path
    for name in ("watch.css", "watch.js", "canvas.js"):
        assert locked.get(f"{url}/watch/{name}").status_code == 200


def test_a_key_opens_nothing_else(locked, watched):
    url, key = watched
    other = locked.post("/v1/envs/", json={"env_id": "CartPole-v1"}, headers=bearer())
    other = f"/v1/envs/{other.json['instance_id']}"
    reads = ["/v1/envs/", "/v1/health/", f"{url}/", f"{url}/render/", f"{url}/action_space/sample/"]
    reads += [f"{other}/watch/", f"{other}/watch/state/", f"{url}/watch/../render/"]
    reads += [f"{url}/watch/state/../../render/", f"{url}%2fwatch/../", f"{url}/watch/%2e%2e/"]
    reads += [f"{url}/model/"]
    for path in reads:
        assert locked.get(f"{path}?key={key}").status_code == 401, path
    posts = [f"{url}/watch/key/", f"{url}/watch/", f"{url}/watch/state/", f"{url}/step/"]
    for path in (*posts, f"{url}/reset/", f"{url}/close/", "/v1/shutdown/"):
        answer = locked.post(f"{path}?key={key}", json={"action": 0})
        assert answer.status_code == 401, path
    for wrong in ("", "x", "\0", "%ff", key[:-1], key + "x", TOKEN):
        assert locked.get(f"{url}/watch/state/", query_string={"key": wrong}).status_code == 401


def test_where_no_id_stands_only_the_token_opens(locked, watched):
    _, key = watched
    for instance_id in ("zzzz", "..", "%2e%2e", "0A", "0 "):
        for name in ("", "state/", "presence/", "watch.css", "watch.js", "nothing.js"):
            url = f"/v1/envs/{instance_id}/watch/{name}?key={key}"
            answer = locked.get(url, headers={"Accept": "text/html"})
            assert (answer.status_code, answer.json["code"]) == (401, "unauthorized"), url
            assert locked.get(url, headers=bearer()).status_code != 401, url


def test_a_page_with_a_dead_key_is_a_page_that_says_so(locked, watched):
    url, _ = watched
    page = locked.get(f"{url}/watch/?key=dead", headers={"Accept": "text/html"})
    assert (page.status_code, page.mimetype) == (401, "text/html")
    assert "Content-Security-Policy" in page.headers and "WWW-Authenticate" in page.headers
    said = locked.get(f"{url}/watch/state/?key=dead").json
    assert "has expired" in said["message"]
    assert "env_watch()" in said["hint"]


def test_where_no_token_is_asked_for_there_are_no_keys(client, create):
    url = create()
    assert client.post(f"{url}/watch/key/").json == {"key": None, "seconds": None}
    assert client.get(f"{url}/watch/").status_code == 200
