import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete, Graph
from refusals import refused

from gym_server.spaces import decode, encode

SPACE = Graph(Box(0, 1, (2,), np.float32), Discrete(3))
VALUE = {"nodes": [[0, 1], [0.5, 0.5]], "edges": [2, 0], "edge_links": [[0, 1], [1, 1]]}


def but(**parts):
    return {**VALUE, **parts}


def test_nodes_and_edges_are_arrays():
    graph = decode(SPACE, VALUE)
    assert (graph.nodes.dtype, graph.nodes.shape) == (np.float32, (2, 2))
    assert graph.edges.tolist() == [2, 0]
    assert (graph.edge_links.dtype, graph.edge_links.tolist()) == (np.int32, [[0, 1], [1, 1]])
    assert graph in SPACE
    assert encode(SPACE, graph) == VALUE


@pytest.mark.parametrize("value", [{"nodes": [[0, 1]]}, but(edges=None, edge_links=None)])
def test_edges_may_be_absent(value):
    graph = decode(SPACE, value)
    assert graph.edges is None
    assert graph.edge_links is None
    assert encode(SPACE, graph)["edges"] is None


def test_no_edges_are_not_the_same_as_absent_ones():
    graph = decode(SPACE, but(edges=[], edge_links=[]))
    assert (graph.edges.shape, graph.edge_links.shape) == ((0,), (0, 2))
    assert encode(SPACE, graph)["edge_links"] == []


def test_there_may_be_no_nodes():
    assert decode(SPACE, {"nodes": []}).nodes.shape == (0, 2)


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (but(nodes=[[0, 1], [0, "x"]]), '"x" at $nodes[1][1] is not in Box'),
        (but(edges=[2, 3]), "3 at $edges[1] is not in Discrete(3)"),
        (but(edge_links=[[0, 1], [1, 2]]), "2 at $edge_links[1][1] is not in MultiDiscrete"),
        (but(edge_links=[[0, 1], [1, -1]]), "-1 at $edge_links[1][1] is not in MultiDiscrete"),
        (but(edge_links=[[0, 1], [1, 0.5]]), "0.5 at $edge_links[1][1] is not in MultiDiscrete"),
        (but(edge_links=[[0, 1], [1]]), "[[0, 1], [1]] at $edge_links is not in MultiDiscrete"),
        (but(edge_links=[[0, 1], 1]), "[[0, 1], 1] at $edge_links is not in MultiDiscrete"),
        (but(nodes={}), "{} is not in Graph"),
    ],
)
def test_what_is_no_member_is_refused_with_its_place(value, words):
    assert refused(SPACE, value).startswith(words)


@pytest.mark.parametrize(
    ("value", "reason"),
    [
        ({}, "it has no nodes"),
        (but(nodes=[]), "it has no nodes"),
        (but(nodes={}), "nodes must be a list"),
        ([], "an object of nodes, edges and edge_links is needed"),
        (but(weights=[1]), "an object of nodes, edges and edge_links is needed"),
        (but(edges=None), "each edge needs a link, and each link an edge"),
        (but(edge_links=[[0, 1]]), "each edge needs a link, and each link an edge"),
    ],
)
def test_a_graph_that_does_not_hang_together_is_refused(value, reason):
    assert refused(SPACE, value).endswith(reason)


def test_a_space_without_edges_takes_none():
    assert refused(Graph(Discrete(2), None), but(nodes=[0, 1])).endswith("the space has no edges")
