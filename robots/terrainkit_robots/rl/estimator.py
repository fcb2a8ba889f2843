"""An explicit estimator: a network beside the actor that predicts what the robot cannot measure.

It is trained with the policy, as in Ji et al., Concurrent Training of a Control Policy and a State
Estimator for Dynamic and Robust Legged Locomotion, 2022.
"""

from collections.abc import Callable
from copy import deepcopy
from typing import Any

import torch
from rsl_rl.models import MLPModel
from rsl_rl.modules import MLP
from tensordict import TensorDict

ESTIMATE = "estimate"
"""Observation group with the simulated values that the estimator predicts."""

NUM_EPOCHS, LEARNING_RATE = 2, 1e-3
"""Passes over the samples of an iteration, and the learning rate; that of PPO falls to 1e-5."""

FORCED_ITERATIONS = 800
"""Iterations in which the policy observes a mean of simulated and estimated values, at most half of
a training. The share of the simulated values falls from 1 to 0."""


class EstimatorModel(MLPModel):
    """rsl-rl's actor, which also observes the estimates that a network makes of its observations.

    Args:
        obs: Observations by group, with the group `estimate`.
        obs_groups: Groups of each observation set.
        obs_set: Observation set of the model.
        output_dim: Number of actions.
        estimator_hidden_dims: Widths of the hidden layers of the estimator.
        settings: Other settings of `MLPModel`.
    """

    forced: torch.Tensor
    """Share of the simulated values in what the policy observes: teacher forcing."""

    def __init__(
        self,
        obs: TensorDict,
        obs_groups: dict[str, list[str]],
        obs_set: str,
        output_dim: int,
        *,
        estimator_hidden_dims: list[int],
        **settings: Any,
    ) -> None:
        self._estimate_dim = obs[ESTIMATE].shape[-1]
        super().__init__(obs, obs_groups, obs_set, output_dim, **settings)
        sizes = self.obs_dim, self._estimate_dim, estimator_hidden_dims, settings["activation"]
        self.estimator = MLP(*sizes)
        self.register_buffer("forced", torch.ones(()))

    def estimate(self, obs: TensorDict) -> torch.Tensor:
        """Return the estimates, shape (n, width of the group `estimate`)."""
        estimates: torch.Tensor = self.estimator(super().get_latent(obs))
        return estimates

    def get_latent(self, obs: TensorDict, *args: Any) -> torch.Tensor:
        """Return the normalized observations, and the estimates, which PPO does not change."""
        latent = super().get_latent(obs, *args)
        estimates = self.estimator(latent).detach()
        if self.training and self.forced > 0:
            estimates = estimates.lerp(obs[ESTIMATE], self.forced)
        return torch.cat([latent, estimates], dim=-1)

    def as_jit(self) -> torch.nn.Module:
        """Return the policy for TorchScript."""
        return self._with_estimator(super().as_jit())

    def as_onnx(self, verbose: bool) -> torch.nn.Module:
        """Return the policy for ONNX."""
        return self._with_estimator(super().as_onnx(verbose))

    def _with_estimator(self, exported: torch.nn.Module) -> torch.nn.Module:
        exported.mlp = _EstimatorMLP(self.estimator, exported.mlp)
        return exported

    def _get_latent_dim(self) -> int:
        return self.obs_dim + self._estimate_dim


class _EstimatorMLP(torch.nn.Module):
    """The estimator, and the network of the policy behind it."""

    def __init__(self, estimator: torch.nn.Module, policy: torch.nn.Module) -> None:
        super().__init__()
        self.estimator, self.policy = deepcopy(estimator), policy

    def forward(self, obs: torch.Tensor) -> torch.Tensor:
        """Return the output of the policy for normalized observations, shape (n, k)."""
        output: torch.Tensor = self.policy(torch.cat([obs, self.estimator(obs)], dim=-1))
        return output


def estimator_update(
    alg: Any, augment: Callable[[TensorDict], TensorDict], forced_iterations: int
) -> Callable[[], dict[str, float]]:
    """Return the update of PPO, followed by an update of the actor's estimator.

    Updated before or with the policy, the estimator would change the actions within an iteration,
    whose probabilities PPO compares.

    Args:
        alg: rsl-rl's PPO, whose actor is an `EstimatorModel`.
        augment: Adds samples to observations, such as their mirror images.
        forced_iterations: Iterations in which the policy also observes simulated values.
    """
    update, actor = alg.update, alg.actor

    def update_both() -> dict[str, float]:
        losses: dict[str, float] = update()  # it keeps the samples until the next iteration
        obs = alg.storage.observations.flatten(0, 1)
        total = 0.0
        # PPO's optimizer, so that a checkpoint has its state; weights without a gradient stay.
        for group in alg.optimizer.param_groups:
            group["lr"] = LEARNING_RATE
        for _ in range(NUM_EPOCHS):
            for index in torch.randperm(len(obs)).tensor_split(alg.num_mini_batches):
                batch = augment(obs[index.to(alg.device)])
                loss = (actor.estimate(batch) - batch[ESTIMATE]).square().mean()
                alg.optimizer.zero_grad()
                loss.backward()
                if alg.is_multi_gpu:
                    alg.reduce_parameters()
                alg.optimizer.step()
                total += loss.item()
        for group in alg.optimizer.param_groups:
            group["lr"] = alg.learning_rate
        actor.forced.sub_(1 / max(1, forced_iterations)).clamp_(min=0)
        losses["estimator"] = total / (NUM_EPOCHS * alg.num_mini_batches)
        return losses

    return update_both
