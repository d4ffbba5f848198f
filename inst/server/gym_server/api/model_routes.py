"""The route that tells how an environment moves, for methods that plan instead of trying."""

from __future__ import annotations

from gym_server.api import schemas
from gym_server.api.calls import Call
from gym_server.api.routing import INSTANCE, Table
from gym_server.protocol.answers import Ready

ROUTES = Table()


@ROUTES.declare(
    "GET",
    INSTANCE + "model/",
    answer="model: num_states and num_actions, both numbered from 0; start, the probability of "
    "each state to be the first of an episode; state, action, next_state, probability, reward and "
    "terminated, each with one element for each transition of a probability above 0, by state and "
    "action. A limit of time is no part of it",
    grows=True,
    schema=schemas.json_object({"model": schemas.TRANSITION_MODEL}),
)
def env_model(call: Call) -> dict | Ready:
    """Tell the transition model of an environment that has a table of it."""
    return call.instance.transition_model()
