import numpy as np

from gym_server.sb3.networks import network_of


def test_layers_that_policy_and_values_share_come_first():
    sizes = {"shared_net.0": (4, 3), "policy_net.0": (5, 4), "value_net.0": (6, 4)}
    sizes = {f"mlp_extractor.{name}": size for name, size in sizes.items()}
    sizes["action_net"] = (2, 5)
    draws = np.random.default_rng(1)
    weights = {}
    for name, size in sizes.items():
        weights[f"{name}.weight"], weights[f"{name}.bias"] = (
            draws.normal(size=size),
            np.ones(size[0]),
        )
    network = network_of(weights, 2)
    used = ["mlp_extractor.shared_net.0", "mlp_extractor.policy_net.0", "action_net"]
    for layer, name in zip(network.layers, used, strict=True):
        np.testing.assert_array_equal(layer[:, :-1], weights[f"{name}.weight"])
    assert network.activation == ["tanh", "tanh", "identity"]
