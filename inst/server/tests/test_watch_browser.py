"""The watch page in a real browser, while R searches and Python plays."""

import contextlib
import json
import os
import re
import subprocess
import threading
import time

import pytest
from conftest import TOKEN
from running import r_has_the_package

selenium = pytest.importorskip("selenium", reason="selenium is not installed (the extra 'dev')")

from selenium.webdriver.common.by import By  # noqa: E402
from selenium.webdriver.common.keys import Keys  # noqa: E402
from watch_page import (  # noqa: E402
    complaints,
    moves,
    number,
    pace,
    picture,
    pictures,
    start_chromium,
    text,
)

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def chromium():
    """Start a headless browser."""
    browser = start_chromium()
    if browser is None:
        pytest.skip("there is no Chromium with its chromedriver on the PATH")
    yield browser
    browser.quit()


@pytest.fixture
def browser(chromium):
    """Return a browser with an empty page, and leave it so."""
    chromium.get("about:blank")
    chromium.get_log("browser")
    yield chromium
    for window in chromium.window_handles[1:]:
        chromium.switch_to.window(window)
        chromium.close()
    chromium.switch_to.window(chromium.window_handles[0])
    chromium.get("about:blank")


@pytest.fixture
def server(shared):
    return shared


@pytest.fixture
def play(server):
    """Play in the background until the end of the test."""
    threads, over = [], threading.Event()

    def play(url, pause=0.0, render=False):
        def run():
            connection = server.connect()

            def call(method, path, **fields):
                body = json.dumps(fields) if method == "POST" else None
                connection.request(method, url + path, body)
                return json.loads(connection.getresponse().read())

            # Until the server or the environment is closed.
            with contextlib.suppress(Exception), contextlib.closing(connection):
                call("POST", "/reset/", seed=1)
                while not over.wait(pause):
                    action = call("GET", "/action_space/sample")["action"]
                    out = call("POST", "/step/", action=action, render=render)
                    if out["done"] is True:
                        call("POST", "/reset/")

        threads.append(threading.Thread(target=run))
        threads[-1].start()

    yield play
    over.set()
    for thread in threads:
        thread.join()


@pytest.fixture
def look(browser, server):
    """Open an environment's page."""
    return lambda url: browser.get(f"http://127.0.0.1:{server.port}{url}/watch/")


# A search from R -----------------------------------------------------------------------------

_SEARCH = """
library(gym)
options(gym.viewer = function(address) cat(address, "\\n", sep = "", file = stdout()))
env <- gym_make("CartPole-v0", render_mode = "human")
search_random(env, rounds = 500, target = Inf, seed = 1, progress = FALSE)
"""


@pytest.fixture
def search(server):
    """Start a watched search from R on the test's server; return the page's address."""
    if not r_has_the_package():
        pytest.skip("there is no R with this package")
    process = subprocess.Popen(
        ["Rscript", "-e", _SEARCH],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "GYM_SERVER_URL": f"http://127.0.0.1:{server.port}"},
        text=True,
    )
    yield process.stdout.readline().strip()
    process.kill()
    process.wait()
    process.stdout.close()


def test_a_search_from_r_is_seen_while_somebody_looks(browser, server, search, eventually):
    assert search.endswith("/watch/")
    url = search.removeprefix(f"http://127.0.0.1:{server.port}").removesuffix("/watch/")
    browser.get(search)
    eventually(lambda: text(browser, "env") == "CartPole-v0")
    # The picture and the counters change.
    eventually(lambda: number(browser, "step") > 0)
    assert moves(browser)
    episode = number(browser, "episode")
    eventually(lambda: number(browser, "episode") > episode + 1, seconds=30)
    eventually(lambda: "mean" in text(browser, "mean"))
    assert text(browser, "state") == "live"
    assert "real time" in text(browser, "pace")

    # Pause affects only this view.
    steps = server.get(url)[1]["steps"]
    browser.find_element(By.TAG_NAME, "body").send_keys(Keys.SPACE)
    eventually(lambda: text(browser, "state") == "paused")
    assert len(pictures(browser)) == 1
    assert server.get(url)[1]["steps"] > steps
    browser.find_element(By.ID, "pause").click()
    assert moves(browser)
    assert complaints(browser) == []

    # Without the page, no step waits for watchers any more.
    browser.get("about:blank")
    eventually(lambda: not server.get(url)[1]["watched"])
    eventually(lambda: pace(server, url) > 60, seconds=60)


# What Python plays ---------------------------------------------------------------------------


def test_two_people_watch_and_only_one_of_them_pauses(browser, server, play, look, eventually):
    url = server.create("MountainCar-v0")
    play(url, pause=0.01)
    look(url)
    first = browser.current_window_handle
    browser.switch_to.new_window("window")
    look(url)
    eventually(lambda: number(browser, "step") > 0)
    browser.find_element(By.ID, "pause").click()
    eventually(lambda: text(browser, "state") == "paused")
    assert len(pictures(browser)) == 1
    browser.switch_to.window(first)
    assert moves(browser)


@pytest.fixture
def in_slow_motion(browser, server, play, look, eventually):
    """Choose a speed; return functions for the episode that is shown, and the one played."""

    def in_slow_motion(speed):
        url = server.create("CartPole-v1")
        play(url, pause=0.02)
        look(url)
        eventually(lambda: number(browser, "step") > 0)
        choice = browser.find_element(By.CSS_SELECTOR, f"input[value='{speed}']")
        browser.execute_script("arguments[0].click()", choice)
        return (
            lambda: number(browser, "episode"),
            lambda: server.get(f"{url}/watch/state/")[1]["episode"],
        )

    return in_slow_motion


@pytest.mark.parametrize("speed", ["2", "4"])
def test_slow_motion_is_slower_than_what_is_played(browser, in_slow_motion, eventually, speed):
    shown, played = in_slow_motion(speed)
    eventually(lambda: shown() < played() - 1)
    assert moves(browser)


def test_slow_motion_goes_on_from_the_present(in_slow_motion, eventually):
    shown, played = in_slow_motion("2")
    eventually(lambda: shown() < played() - 1)
    # Two seconds take four; then the page shows the current state.
    eventually(lambda: shown() >= played(), seconds=30)


def test_what_is_not_drawn_shows_its_observations(browser, server, play, look, eventually):
    url = server.create("faulty_envs:Counting-v0")
    play(url, pause=0.02)
    look(url)
    eventually(lambda: "draws no pictures" in text(browser, "why"))
    canvas = browser.find_element(By.ID, "observation")
    assert canvas.is_displayed()
    assert not browser.find_element(By.ID, "picture").is_displayed()
    said = canvas.get_attribute("aria-label")
    eventually(lambda: canvas.get_attribute("aria-label") != said)
    assert complaints(browser) == []


def test_a_sub_env_is_chosen_on_the_page(browser, server, look, eventually):
    url = server.create("CartPole-v1", num_envs=3, vectorization_mode="sync")
    server.post(f"{url}/reset/", {"seed": 1})
    look(url)
    eventually(lambda: text(browser, "of") == "of 3")
    eventually(lambda: browser.find_element(By.ID, "picture").is_displayed())
    first = picture(browser)
    sub_env = browser.find_element(By.ID, "sub_env")
    sub_env.clear()
    sub_env.send_keys("3" + Keys.ENTER)
    eventually(lambda: picture(browser) != first)
    label = browser.find_element(By.ID, "picture").get_attribute("aria-label")
    assert "sub-environment 3" in label
    assert "of all 3" in text(browser, "caption")


@pytest.mark.parametrize(
    ("num_envs", "together", "each"), [(None, "", ""), (4, ", all 4 together", " each")]
)
def test_the_pace_is_that_of_all_and_real_time_that_of_each(
    browser, server, play, look, eventually, num_envs, together, each
):
    url = server.create("CartPole-v1", num_envs=num_envs, render_mode="human")
    play(url)
    look(url)
    eventually(lambda: "a second" in text(browser, "pace"))
    words, real = text(browser, "pace").split(" · ")
    assert re.fullmatch(rf"about [\d,]+ steps a second{together}", words)
    assert real == f"real time (at most 50{each})"


def test_what_is_not_there_is_said_in_words(browser, server, look, eventually):
    url = server.create("CartPole-v1")
    look(url)
    eventually(lambda: text(browser, "words") == "Not reset yet")
    server.post(f"{url}/reset/")
    eventually(lambda: not browser.find_element(By.ID, "message").is_displayed())
    eventually(lambda: text(browser, "state") == "standing still")
    other = server.create("MountainCar-v0")
    server.post(f"{url}/close/")
    eventually(lambda: text(browser, "words") == "This environment is closed")
    eventually(lambda: "MountainCar-v0" in text(browser, "others"))
    browser.find_element(By.CSS_SELECTOR, "#others a").click()
    eventually(lambda: browser.current_url.endswith(f"{other}/watch/"))
    look("/v1/envs/00000000")
    eventually(lambda: text(browser, "words") == "This environment is closed")


def test_a_server_that_is_gone_and_comes_back_is_noticed(browser, serve, eventually):
    server = serve()
    url = server.create("CartPole-v1")
    server.post(f"{url}/reset/")
    browser.get(f"http://127.0.0.1:{server.port}{url}/watch/")
    eventually(lambda: text(browser, "env") == "CartPole-v1")
    server.stop()
    eventually(lambda: text(browser, "words") == "The server is gone")
    serve("--port", str(server.port))
    # A new server does not know it.
    eventually(lambda: text(browser, "words") == "This environment is closed")


def test_a_page_says_why_its_environment_ended(browser, server, eventually):
    fields = {"num_envs": 1, "num_workers": 1, "kwargs": {"does": "exits"}}
    url = server.create("faulty_envs:Rogue-v0", **fields)
    browser.get(f"http://127.0.0.1:{server.port}{url}/watch/")
    eventually(lambda: text(browser, "words") == "Not reset yet")
    server.post(f"{url}/reset/")
    server.post(f"{url}/step/", {"action": [0]})
    eventually(lambda: "exit status 7" in text(browser, "words"))
    assert text(browser, "state") == "closed"


# With a token -------------------------------------------------------------------------------


@pytest.fixture
def locked(serve):
    """Start a server with a token; return it, and a function that uses the token."""
    server = serve(GYM_SERVER_TOKEN=TOKEN)

    def ask(path, **fields):
        with contextlib.closing(server.connect()) as connection:
            headers = {"Authorization": f"Bearer {TOKEN}"}
            connection.request("POST", path, json.dumps(fields), headers)
            return json.loads(connection.getresponse().read() or "null")

    return server, ask


def test_a_link_with_a_key_opens_the_page_and_without_one_it_says_what_to_do(
    browser, locked, eventually
):
    server, ask = locked
    url = f"/v1/envs/{ask('/v1/envs/', env_id='CartPole-v1')['instance_id']}"
    ask(f"{url}/reset/", seed=1)
    page = f"http://127.0.0.1:{server.port}{url}/watch/"
    browser.get(f"{page}?key={ask(f'{url}/watch/key/')['key']}")
    eventually(lambda: browser.find_element(By.ID, "picture").is_displayed())
    first = picture(browser)
    ask(f"{url}/step/", action=1)
    eventually(lambda: picture(browser) != first)
    assert text(browser, "env") == "CartPole-v1"
    assert complaints(browser) == []
    # The controls for sub-environment and speed use the key, too.
    browser.find_element(By.ID, "pause").click()
    eventually(lambda: text(browser, "state") == "paused")
    time.sleep(0.5)
    assert text(browser, "state") == "paused"
    ask(f"{url}/close/")
    browser.find_element(By.ID, "pause").click()
    eventually(lambda: text(browser, "words") == "This environment is closed")

    for query, words in (("?key=dead", "has expired"), ("", "needs a link")):
        browser.get(page + query)
        eventually(lambda words=words: words in text(browser, "words"))
        assert "env_watch()" in text(browser, "advice")
        assert text(browser, "state") == "no key"


def test_a_page_from_elsewhere_cannot_drive_a_server(browser, server, serve, eventually):
    """A page of another server on this machine, with a real browser's headers."""
    url = server.create("CartPole-v1")
    other = serve()
    browser.get(f"http://127.0.0.1:{other.port}/v1/health/")
    target = f"http://127.0.0.1:{server.port}"
    for path in (f"{url}/reset/", f"{url}/close/", "/v1/shutdown/"):
        for mode in ("no-cors", "cors"):
            for kind in ("text/plain", "application/json"):
                browser.execute_async_script(
                    """
                    const [url, mode, kind, done] = arguments;
                    const headers = { "Content-Type": kind };
                    fetch(url, { method: "POST", mode, headers, body: "{}" }).then(done, done);
                    """,
                    target + path,
                    mode,
                    kind,
                )
        # Submit a form from the page.
        browser.execute_script(
            """
            const form = document.createElement("form");
            Object.assign(form, { method: "post", action: arguments[0] });
            document.body.append(form);
            form.submit();
            """,
            target + path,
        )
        eventually(lambda: "foreign_origin" in browser.page_source)
        browser.get(f"http://127.0.0.1:{other.port}/v1/health/")
    assert server.get(url)[1]["steps"] == 0
    # The environment was not reset, either.
    assert server.post(f"{url}/step/", {"action": 0})[1]["code"] == "reset_needed"
    server.post(f"{url}/reset/")
    drawn_by_image = browser.execute_async_script(
        """
        const [url, done] = arguments;
        const image = new Image();
        image.onload = () => done(true);
        image.onerror = () => done(false);
        image.src = url;
        """,
        f"{target}{url}/render/",
    )
    assert drawn_by_image is False
    # Following a link is allowed.
    browser.get(f"{target}{url}/watch/")
    assert browser.find_element(By.ID, "picture")


def test_every_control_has_a_name(browser, server, look):
    look(server.create("CartPole-v1", num_envs=2))
    for control in browser.find_elements(By.CSS_SELECTOR, "button, input, canvas"):
        if control.is_displayed():
            assert control.accessible_name
