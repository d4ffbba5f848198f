"""Graph: nodes, and edges between them."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.spaces import Graph, GraphInstance, MultiDiscrete

from gym_server.spaces.kinds import (
    NotInSpace,
    decode,
    decode_part,
    description,
    encode,
    encode_members,
)
from gym_server.spaces.stacking import stack


@description.register
def _(space: Graph) -> dict[str, object]:
    return {
        "name": "Graph",
        "dtype": None,
        "node_space": description(space.node_space),
        "edge_space": None if space.edge_space is None else description(space.edge_space),
    }


@encode.register
def _(space: Graph, value: GraphInstance) -> object:
    return {
        "nodes": encode_members(space.node_space, value.nodes),
        "edges": None if value.edges is None else encode_members(space.edge_space, value.edges),
        "edge_links": None if value.edge_links is None else np.asarray(value.edge_links).tolist(),
    }


@decode.register
def _(space: Graph, value: object) -> object:
    if not isinstance(value, dict) or not value.keys() <= {"nodes", "edges", "edge_links"}:
        raise NotInSpace(space, value, "an object of nodes, edges and edge_links is needed")
    nodes, edges, links = (_list(space, value, name) for name in ("nodes", "edges", "edge_links"))
    if nodes is None or (links and not nodes):
        raise NotInSpace(space, value, "it has no nodes")
    if space.edge_space is None and edges is not None:
        raise NotInSpace(space, value, "the space has no edges")
    if (edges is None) != (links is None) or len(edges or ()) != len(links or ()):
        raise NotInSpace(space, value, "each edge needs a link, and each link an edge")
    return GraphInstance(
        _decode_batch(space.node_space, nodes, "nodes"),
        None if edges is None else _decode_batch(space.edge_space, edges, "edges"),
        None if links is None else _decode_links(links, len(nodes)),
    )


def _list(space: Graph, value: dict, name: str) -> list | None:
    part = value.get(name)
    if part is not None and not isinstance(part, list):
        raise NotInSpace(space, part, f"{name} must be a list")
    return part


def _decode_batch(space: Any, items: list, name: str) -> Any:
    return stack(space, [decode_part(space, item, name, index) for index, item in enumerate(items)])


def _decode_links(links: list, nodes: int) -> np.ndarray:
    """Decode the two ends of each edge, numbers of nodes from 0."""
    if not links:
        return np.empty((0, 2), dtype=np.int32)
    ends: Any = decode_part(MultiDiscrete(np.full((len(links), 2), nodes)), links, "edge_links")
    return np.asarray(ends, dtype=np.int32)
