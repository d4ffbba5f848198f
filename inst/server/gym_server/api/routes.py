"""The protocol's routes, by noun."""

from gym_server.api import (
    env_routes,
    monitor_routes,
    rollout_routes,
    server_routes,
    space_routes,
    watch_routes,
)

ROOMS = (
    env_routes.ROOM,
    space_routes.ROOM,
    monitor_routes.ROOM,
    rollout_routes.ROOM,
    watch_routes.ROOM,
    server_routes.ROOM,
)
ROUTES = tuple(route for room in ROOMS for route in room.routes.values())
