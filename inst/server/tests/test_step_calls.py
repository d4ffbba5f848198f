"""How much Python a step by HTTP runs, besides the environment."""

import json
import socket
import sys
import threading

from conftest import TOKEN
from raw_http import answered, request

from gym_server.api.access import Access
from gym_server.api.app import Config, create_app
from gym_server.http_server.connection import Connection

# Function calls between the arrival of the request and the response.
MOST_CALLS = 60


def test_a_step_by_http_takes_few_calls():
    called = []

    def note(frame, event, argument):
        name = frame.f_code.co_filename
        if event == "call" and "gymnasium" not in name and "numpy" not in name:
            called.append(f"{name}:{frame.f_code.co_name}")

    app = create_app(Config(access=Access(TOKEN)))
    with socket.create_server(("127.0.0.1", 0)) as listener:
        client = socket.create_connection(listener.getsockname(), timeout=30)
        connection = Connection(listener.accept()[0], app, {}, 2**20)

    def serve():
        sys.setprofile(note)
        connection.serve()

    thread = threading.Thread(target=serve)
    thread.start()

    def ask(number, path, **fields):
        body = json.dumps({**fields, "request": {"key": "k", "number": number}}).encode()
        headers = (
            f"Authorization: Bearer {TOKEN}",
            "Content-Type: application/json",
            "Accept: */*",
        )
        status, _, answer, _ = answered(client, request("POST", path, body, *headers))
        assert status == 200, answer
        return json.loads(answer)

    with client:
        url = f"/v1/envs/{ask(1, '/v1/envs/', env_id='CartPole-v1')['instance_id']}"
        ask(1, f"{url}/reset/")
        counts = []
        for number in range(2, 8):
            before = len(called)
            ask(number, f"{url}/step/", action=number % 2)
            counts.append(len(called) - before)
    thread.join(10)
    app.close()
    assert min(counts) <= MOST_CALLS, "\n".join(called[-max(counts) :])
