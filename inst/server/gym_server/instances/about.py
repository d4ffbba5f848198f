"""What clients are told about an instance, without waiting for its environment."""

from __future__ import annotations

import time

from gym_server.envs.extras import engine_versions
from gym_server.instances.instance import Instance
from gym_server.json_values import plain


def list_entry(instance: Instance) -> dict:
    """Return the entry in the list of instances."""
    now = time.monotonic()
    return {
        "instance_id": instance.instance_id,
        "env_id": instance.env_id,
        "name": instance.config.name,
        "num_envs": instance.config.num_envs,
        "age_seconds": now - instance.created,
        "idle_seconds": now - instance.lock.used,
        "steps": instance.steps,
        "watched": instance.viewer.is_watched,
    }


def about(instance: Instance) -> dict:
    """Return everything known about an instance."""
    spec, config, monitor = instance.gym_env.spec, instance.config, instance.monitor
    return {
        **list_entry(instance),
        **instance.single_space_info,
        "reward_threshold": spec.reward_threshold if spec else None,
        "max_episode_steps": instance.max_episode_steps,
        "render_fps": plain(instance.render_fps),
        "engine": engine_versions(spec) if spec else {},
        "warnings": list(instance.warnings),
        "vectorization_mode": instance.vectorization_mode,
        "num_workers": instance.num_workers,
        "autoreset_mode": instance.autoreset_mode,
        "render_mode": config.render_mode or instance.gym_env.render_mode,
        "kwargs": config.kwargs or {},
        "wrappers": [wrapper._asdict() for wrapper in config.wrappers],
        "seed": config.seed,
        "episode_steps": instance.statistics.of(0)["step"] if config.num_envs is None else None,
        "needs_reset": instance.has_ended or not instance.was_reset,
        "monitor": monitor.about() if monitor else None,
    }
