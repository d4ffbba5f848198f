"""Train PPO by Stable-Baselines3 in one thread, for the benchmark.

Each line of the input is a JSON object with the settings of one training. The answer is a line with
the processor seconds of learning, the steps, and whether the stopping rule was met: the last 100
training episodes have at least a mean return.
"""

import json
import sys
import time

import gymnasium
import torch
from stable_baselines3 import PPO, __version__
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv

torch.set_num_threads(1)


class UntilTarget(BaseCallback):
    """Stops when the mean return of the last 100 episodes reaches the target."""

    def __init__(self, target):
        super().__init__()
        self.target = target
        self.reached = False

    def _on_step(self):
        return not self.reached

    def _on_rollout_end(self):
        returns = [episode["r"] for episode in self.model.ep_info_buffer]
        self.reached = len(returns) == 100 and sum(returns) / 100 >= self.target


def linear(first):
    """Return a schedule that decreases to 0."""
    return lambda left: left * first


def train(task):
    """Train once and return the figures."""
    # make_vec_env() would make some environments draw each step.
    envs = DummyVecEnv([lambda: Monitor(gymnasium.make(task["env_id"]))] * task["num_envs"])
    schedule = linear if task["linear"] else float
    model = PPO(
        "MlpPolicy",
        envs,
        n_steps=task["rows"] // task["num_envs"],
        batch_size=task["batch"],
        n_epochs=task["epochs"],
        gamma=task["discount"],
        gae_lambda=task["lambda"],
        learning_rate=schedule(task["learning_rate"]),
        clip_range=schedule(task["clip"]),
        ent_coef=task["entropy"],
        seed=task["seed"],
        device="cpu",
    )
    until = UntilTarget(float(task["target"]))
    started = time.process_time()
    model.learn(int(task["total_steps"]), callback=until)
    seconds = time.process_time() - started
    return {"seconds": seconds, "steps": model.num_timesteps, "reached": until.reached}


for line in sys.stdin:
    asked = json.loads(line)
    if asked == "versions":
        answer = {"stable_baselines3": __version__, "torch": torch.__version__}
    else:
        answer = train(asked)
    print(json.dumps(answer), flush=True)
