"""When connections are cut within a request or response, no step is lost or taken twice.

``GYM_TEST_CUTS=all``, which ``make soak`` sets, cuts at each byte.
"""

import os

import pytest
from cutting import Cutter, NumberedClient

EVERY = 1 if os.environ.get("GYM_TEST_CUTS") == "all" else 23


@pytest.fixture
def cutter(serve):
    server = serve()
    cutter = Cutter(server.port)
    yield cutter
    cutter.close()


def test_a_step_that_was_cut_at_any_byte_is_taken_once(cutter, capsys):
    client = NumberedClient(cutter.address, "k")
    made = client.post(
        "/v1/envs/", env_id="faulty_envs:Counting-v0", kwargs={"length": 10**6}, seed=1
    )
    url = f"/v1/envs/{made['instance_id']}"
    client.post(f"{url}/reset/")
    steps = 0

    def play(where, after):
        nonlocal steps
        request = client.request(f"{url}/step/", action=1)
        cutter.cut(where, after)
        answer = client.send(request)
        steps += 1
        # The environment observes the number of its steps.
        assert answer["observation"] == [steps], (where, after)
        assert answer["request"]["number"] == client.number, (where, after)

    places = {"request": 0, "answer": 0}
    play(None, 0)
    # Numbers get longer during the test.
    longest = {where: size + 8 for where, size in cutter.sizes.items()}
    for where, most in longest.items():
        for after in range(0, most, EVERY):
            before = cutter.cuts, client.repeats
            play(where, after)
            assert cutter.cuts == before[0] + 1, (where, after)
            if client.repeats > before[1]:
                places[where] += 1
            else:
                # It was complete before the cut.
                assert after > 100
    client.close()
    assert all(places.values())
    if EVERY == 1:
        # Each byte except the last, where the message is complete.
        assert places["request"] > 100
        assert places["answer"] > 200
        with capsys.disabled():
            print(
                f"\ncuts: at {places['request']} bytes of a request and {places['answer']} of an "
                f"answer, {steps} steps, lost or doubled 0"
            )
