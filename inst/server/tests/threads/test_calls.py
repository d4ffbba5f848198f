"""What this process is running, by which a call that hangs is found."""

import threading

import pytest
from conftest import Gate, created

from gym_server.threads import calls


@pytest.fixture
def in_thread(client):
    """Send a request in a thread; afterwards every such request must have ended well."""
    threads, statuses = [], []

    def in_thread(method, path, body=None):
        def send():
            answer = client.application.test_client().open(path, method=method, json=body)
            statuses.append(answer.status_code)

        threads.append(threading.Thread(target=send))
        threads[-1].start()

    yield in_thread
    for thread in threads:
        thread.join(20)
    assert len(statuses) == len(threads) and all(status < 300 for status in statuses)


@pytest.mark.parametrize("fields", [{}, {"num_envs": 2, "num_workers": 0, "name": "mine"}])
@pytest.mark.parametrize(
    ("where", "method", "path"),
    [
        ("reset", "POST", "reset/"),
        ("step", "POST", "step/"),
        ("render", "GET", "render/"),
        ("render", "GET", "watch/state/"),
        ("close", "POST", "close/"),
    ],
)
def test_a_call_that_hangs_is_found_and_named(
    client, in_thread, gate, eventually, where, method, path, fields
):
    kwargs = {**gate.kwargs, "where": where}
    url = created(client, "faulty_envs:Gated-v0", kwargs=kwargs, **fields)
    action = [0, 0] if fields else 0
    if where != "reset":
        client.post(f"{url}/reset/")
    assert calls.overdue(-1) is None
    in_thread(method, f"{url}/{path}", {"action": action} if where == "step" else None)
    eventually(gate.is_reached)
    name = " (name 'mine')" if fields else ""
    assert calls.overdue(-1) == (
        f"{where}() of instance {url.rsplit('/', 1)[1]} of faulty_envs:Gated-v0{name}"
    )
    assert calls.overdue(60) is None
    gate.open()
    eventually(lambda: not calls.running)


@pytest.mark.parametrize("fields", [{}, {"num_envs": 2, "num_workers": 0}])
def test_an_environment_that_hangs_while_it_is_made_is_found(in_thread, gate, eventually, fields):
    kwargs = {**gate.kwargs, "where": "init"}
    in_thread("POST", "/v1/envs/", {"env_id": "faulty_envs:Gated-v0", "kwargs": kwargs, **fields})
    eventually(gate.is_reached)
    assert calls.overdue(-1) == "Making faulty_envs:Gated-v0"
    gate.open()
    eventually(lambda: not calls.running)


def test_to_wait_for_a_lock_or_the_render_thread_is_no_hang(
    client, in_thread, gate, tmp_path, eventually
):
    (tmp_path / "drawn").mkdir()
    drawn = Gate(tmp_path / "drawn")
    kwargs = {**gate.kwargs, "where": "render"}
    drawing = created(client, "faulty_envs:Gated-v0", kwargs=kwargs)
    other = created(client, "faulty_envs:Gated-v0", kwargs={**drawn.kwargs, "where": "render"})
    for url in (drawing, other):
        client.post(f"{url}/reset/")
    in_thread("GET", f"{drawing}/render/")
    eventually(gate.is_reached)
    in_thread("POST", f"{drawing}/reset/")
    in_thread("GET", f"{other}/render/")
    instance = client.application._instances.get(other.rsplit("/", 1)[1])
    eventually(lambda: instance.lock.is_held)
    eventually(lambda: len(calls.running) == 1)
    assert drawing.rsplit("/", 1)[1] in calls.overdue(-1)
    gate.open()
    eventually(drawn.is_reached)
    eventually(lambda: len(calls.running) == 1)
    assert other.rsplit("/", 1)[1] in calls.overdue(-1)
    drawn.open()
    eventually(lambda: not calls.running)
