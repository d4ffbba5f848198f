"""The protocol's routes, by noun."""

from gym_server.api import (
    env_routes,
    monitor_routes,
    rollout_routes,
    server_routes,
    space_routes,
    stream_routes,
    watch_routes,
)

BLUEPRINTS = (
    env_routes.bp,
    stream_routes.bp,
    space_routes.bp,
    monitor_routes.bp,
    rollout_routes.bp,
    watch_routes.bp,
    server_routes.bp,
)
ROUTES = tuple(route for one in BLUEPRINTS for route in one.routes.values())
