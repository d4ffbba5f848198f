"""The watch page as the server sends it."""

import json

import pytest


@pytest.mark.parametrize("slash", ["", "/"])
def test_the_page_finds_what_belongs_to_it(client, create, slash):
    url = create()
    page = client.get(f"{url}/watch{slash}")
    assert (page.status_code, page.content_type) == (200, "text/html; charset=utf-8")
    here = f"{url}/watch/" if slash else f"{url}/"
    named = [part.split('"')[0] for part in page.text.split('ref="')[1:]]
    named += [part.split('"')[0] for part in page.text.split('src="')[1:]]
    for name in named:
        if name == "data:,":
            continue
        answer = client.get(here + name)
        kind = "text/css" if name.endswith("css") else "text/javascript"
        assert (answer.status_code, answer.mimetype) == (200, kind)


def test_the_page_takes_nothing_from_elsewhere(client, create):
    url = create()
    for name in (
        "",
        "watch.css",
        "watch.js",
        "canvas.js",
        "chart.js",
        "observation.js",
        "playback.js",
    ):
        answer = client.get(f"{url}/watch/{name}")
        policy = answer.headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy
        assert "unsafe" not in policy
        assert "http:" not in answer.text and "https:" not in answer.text
        assert "style=" not in answer.text and "onclick" not in answer.text


def test_a_file_that_is_none_of_the_pages_is_not_served(client, create):
    url = create()
    for name in ("other.js", "..%2fwatch_routes.js", "watch.html", "state.js"):
        assert client.get(f"{url}/watch/{name}").status_code == 404


def test_a_browser_reads_words_about_an_environment_that_is_not_there(client):
    browser = client.get("/v1/envs/00000000/watch/", headers={"Accept": "text/html,*/*"})
    assert (browser.status_code, browser.mimetype) == (400, "text/html")
    other = client.get("/v1/envs/00000000/watch/")
    assert (other.status_code, other.json["message"]) == (400, "Instance_id 00000000 unknown")
    for name in ("state/", "presence/"):
        answer = client.get(f"/v1/envs/00000000/watch/{name}")
        assert (answer.status_code, answer.json["code"]) == (400, "unknown_instance")


def test_what_is_asked_for_must_be_numbers(client, create):
    for query in ("sub_env=x", "after=-1", "after=1.5"):
        answer = client.get(f"{create()}/watch/state/?{query}")
        assert (answer.status_code, answer.json["code"]) == (400, "invalid_parameter")


def test_a_state_is_strict_json_and_is_not_kept(client, create):
    url = create()
    client.post(f"{url}/reset/")
    answer = client.get(f"{url}/watch/state/")
    json.loads(answer.data, parse_constant=pytest.fail)
    assert answer.headers["Cache-Control"] == "no-store"
