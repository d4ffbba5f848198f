"""The steps of PPO and A2C, as tensors where the network learns."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np
import torch
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.type_aliases import RolloutBufferSamples


class DeviceRolloutBuffer(RolloutBuffer):
    """Gives the batches of RolloutBuffer, and copies the steps to the device once.

    RolloutBuffer copies each batch of each epoch. Of pictures these are gigabytes, which a GPU
    waits for.
    """

    generator_ready: bool
    tensors: list[torch.Tensor]

    def get(self, batch_size: int | None = None) -> Generator[RolloutBufferSamples, None, None]:
        """Yield all steps once, in random order and batches of this size."""
        count = self.buffer_size * self.n_envs
        order = torch.as_tensor(np.random.permutation(count), device=self.device)
        if not self.generator_ready:
            observations, actions, *numbers = (
                self.swap_and_flatten(torch.as_tensor(steps, device=self.device))
                for steps in (
                    *(self.observations, self.actions.astype(np.float32, copy=False)),
                    *(self.values, self.log_probs, self.advantages, self.returns),
                )
            )
            self.tensors = [observations, actions, *(steps.flatten() for steps in numbers)]
            self.generator_ready = True
        for chosen in order.split(batch_size or count):
            yield RolloutBufferSamples(*(steps.index_select(0, chosen) for steps in self.tensors))
