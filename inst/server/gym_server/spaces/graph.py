"""Graph: nodes, and edges between them."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.spaces import Graph, GraphInstance

from gym_server.spaces.arrays import read_integer
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
    nodes = _list(space, value, "nodes")
    edges, links = (_list(space, value, name) for name in ("edges", "edge_links"))
    if nodes is None:
        raise NotInSpace(space, value, "it has no nodes")
    if space.edge_space is None and edges is not None:
        raise NotInSpace(space, value, "the space has no edges")
    if (edges is None) != (links is None) or len(edges or ()) != len(links or ()):
        raise NotInSpace(space, value, "each edge needs a link, and each link an edge")
    return GraphInstance(
        _decode_batch(space.node_space, nodes, "nodes"),
        None if edges is None else _decode_batch(space.edge_space, edges, "edges"),
        None if links is None else _decode_links(space, links, len(nodes)),
    )


def _list(space: Graph, value: dict, name: str) -> list | None:
    part = value.get(name)
    if part is not None and not isinstance(part, list):
        raise _refusal(space, part, name, reason="a list is needed")
    return part


def _decode_batch(space: Any, items: list, name: str) -> Any:
    return stack(space, [decode_part(space, item, name, index) for index, item in enumerate(items)])


def _decode_links(space: Graph, links: list, nodes: int) -> np.ndarray:
    for index, link in enumerate(links):
        if not isinstance(link, list) or len(link) != 2:
            raise _refusal(space, link, "edge_links", index, reason="two nodes are needed")
        for end, node in enumerate(link):
            if not _is_node(node, nodes):
                reason = f"there are {nodes} nodes, and the first is 0"
                raise _refusal(space, node, "edge_links", index, end, reason=reason)
    return np.array(links, dtype=np.int32).reshape(len(links), 2)


def _is_node(node: object, nodes: int) -> bool:
    try:
        return 0 <= read_integer(node) < nodes
    except (TypeError, OverflowError):
        return False


def _refusal(space: Graph, value: object, *path: str | int, reason: str) -> NotInSpace:
    refusal = NotInSpace(space, value, reason)
    refusal.path[:] = path
    return refusal
