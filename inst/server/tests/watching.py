"""To play an environment while somebody watches it."""

import contextlib
import threading


def state(client, url, **query):
    answer = client.get(f"{url}/watch/state/", query_string=query)
    assert answer.status_code == 200, answer.json
    return answer.json


def play(client, url, steps=1, action=0, **fields):
    for _ in range(steps):
        answer = client.post(f"{url}/step/", json={"action": action, **fields})
        assert answer.status_code == 200, answer.json


def in_background(call, *args, **how):
    results = []

    def run():
        # The environment may have been closed meanwhile.
        with contextlib.suppress(AssertionError):
            results.append(call(*args, **how))

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    return thread, results
