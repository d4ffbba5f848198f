"""The updates of PPO and DQN in NumPy alone.

Weights are a list of matrices with a row for each neuron; the last column is the bias.
"""

import numpy as np

ACTIVATE = {"tanh": np.tanh, "ReLU": lambda x: np.maximum(x, 0)}
SLOPE = {"tanh": lambda y: 1 - y**2, "ReLU": lambda y: (y > 0).astype(float)}


def vector(layers, extra=()):
    """Return weights in the order of coef(): layer after layer, each matrix column by column."""
    return [float(x) for x in np.concatenate([*(w.ravel("F") for w in layers), extra])]


def forward(layers, observations, activation):
    """Return the inputs of each layer, with their constant 1, and the outputs."""
    seen, signal = [], observations
    for number, weights in enumerate(layers):
        seen.append(np.column_stack([signal, np.ones(len(signal))]))
        signal = seen[-1] @ weights.T
        if number < len(layers) - 1:
            signal = ACTIVATE[activation](signal)
    return seen, signal


def backward(layers, seen, outputs, activation):
    """Return the gradients of the weights, given that of the outputs."""
    gradients, back = [], outputs
    for number in reversed(range(len(layers))):
        gradients.insert(0, back.T @ seen[number])
        if number:
            incoming = seen[number][:, :-1]
            back = (back @ layers[number][:, :-1]) * SLOPE[activation](incoming)
    return gradients


class Adam:
    """Kingma and Ba (2015), algorithm 1, after clipping the norm of the gradient."""

    def __init__(self, learning_rate, eps, max_norm):
        self.learning_rate, self.eps, self.max_norm = learning_rate, eps, max_norm
        self.count, self.first, self.second, self.norms = 0, 0.0, 0.0, []

    def step(self, gradients):
        """Return the change of the weights."""
        flat = np.concatenate([g.ravel() for g in gradients])
        self.norms.append(float(np.sqrt(flat @ flat)))
        flat = flat * min(1.0, self.max_norm / (self.norms[-1] + 1e-6))
        self.count += 1
        self.first = 0.9 * self.first + 0.1 * flat
        self.second = 0.999 * self.second + 0.001 * flat**2
        mean = self.first / (1 - 0.9**self.count)
        square = self.second / (1 - 0.999**self.count)
        change = -self.learning_rate * mean / (np.sqrt(square) + self.eps)
        ends = np.cumsum([g.size for g in gradients])[:-1]
        return [c.reshape(g.shape) for c, g in zip(np.split(change, ends), gradients, strict=True)]


def numpy_ppo(case, policy, value, log_std):
    """Return the weights after each update of PPO."""
    adam = Adam(case["learning_rate"], 1e-5, case["max_grad_norm"])
    observations, actions = np.array(case["observation"]), np.array(case["action"])
    after, clipped = [], 0
    for rows in case["order"]:
        seen_pi, out = forward(policy, observations[rows], "tanh")
        seen_v, values = forward(value, observations[rows], "tanh")
        n, d_log_std = len(rows), np.zeros(0)
        action = actions[rows]
        if log_std is None:
            shifted = out - out.max(1, keepdims=True)
            log_p = shifted - np.log(np.exp(shifted).sum(1, keepdims=True))
            p = np.exp(log_p)
            taken = np.eye(out.shape[1])[action]
            log_prob = (log_p * taken).sum(1)
            d_log_prob = taken - p
            entropies = -(p * log_p).sum(1, keepdims=True)
            d_entropy = -p * (log_p + entropies)
        else:
            z = (action - out) / np.exp(log_std)
            log_prob = (-(z**2) / 2 - log_std - np.log(2 * np.pi) / 2).sum(1)
            d_log_prob = z / np.exp(log_std)
            d_entropy = np.zeros_like(out)
        advantage = np.array(case["advantage"])[rows]
        advantage = (advantage - advantage.mean()) / (advantage.std(ddof=1) + 1e-8)
        ratio = np.exp(log_prob - np.array(case["log_prob"])[rows])
        out_of_reach = np.where(advantage > 0, ratio > 1 + case["clip"], ratio < 1 - case["clip"])
        clipped += out_of_reach.sum()
        weight = -np.where(out_of_reach, 0, advantage * ratio) / n
        d_out = weight[:, None] * d_log_prob - case["entropy"] * d_entropy / n
        error = values[:, 0] - np.array(case["return"])[rows]
        d_values = (2 * case["value_weight"] * error / n)[:, None]
        gradients = backward(policy, seen_pi, d_out, "tanh")
        gradients += backward(value, seen_v, d_values, "tanh")
        if log_std is not None:
            d_log_std = (weight[:, None] * (z**2 - 1)).sum(0) - case["entropy"]
            gradients.append(d_log_std)
        changes = adam.step(gradients)
        if log_std is not None:
            log_std = log_std + changes.pop()
        policy = [w + c for w, c in zip(policy, changes, strict=False)]
        value = [w + c for w, c in zip(value, changes[len(policy) :], strict=True)]
        after.append(vector(policy, () if log_std is None else log_std) + vector(value))
    # Each rule was applied, but not everywhere.
    assert 0 < clipped < len(observations) * len(case["order"]) / 2, clipped
    assert min(adam.norms) < case["max_grad_norm"] < max(adam.norms), adam.norms
    return after


def numpy_dqn(case, values):
    """Return the weights after each update of DQN, and those of its target."""
    adam = Adam(case["learning_rate"], 1e-8, case["max_grad_norm"])
    target = values
    after, errors, differs = [], [], False
    data = {
        name: np.array(case[name])
        for name in ("observation", "action", "reward", "terminated", "next_observation")
    }
    for number, rows in enumerate(case["order"], start=1):
        of = {name: column[rows] for name, column in data.items()}
        n = np.arange(len(rows))
        _, later = forward(target, of["next_observation"], "ReLU")
        chosen = forward(values, of["next_observation"], "ReLU")[1] if case["double"] else later
        differs = differs or (chosen.argmax(1) != later.argmax(1)).any()
        later = later[n, chosen.argmax(1)]
        wanted = of["reward"] + (1 - of["terminated"]) * case["discount"] * later
        seen, out = forward(values, of["observation"], "ReLU")
        error = out[n, of["action"]] - wanted
        errors += list(np.abs(error))
        d_out = np.zeros_like(out)
        d_out[n, of["action"]] = np.clip(error, -1, 1) / len(rows)
        changes = adam.step(backward(values, seen, d_out, "ReLU"))
        values = [w + c for w, c in zip(values, changes, strict=True)]
        if number % case["target_every"] == 0:
            tau = case["tau"]
            target = [(1 - tau) * t + tau * w for t, w in zip(target, values, strict=True)]
        after.append(vector(values))
    assert differs == case["double"]
    assert min(errors) < 1 < max(errors), "Huber's loss has two branches"
    assert min(adam.norms) < case["max_grad_norm"] < max(adam.norms), adam.norms
    return after
