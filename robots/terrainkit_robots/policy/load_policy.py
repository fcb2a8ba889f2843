"""Load policies: the checkpoint of a run, or a function."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import torch
from rsl_rl.models import MLPModel
from rsl_rl.utils import resolve_class
from tensordict import TensorDict

from terrainkit.errors import ConfigError, TerrainkitError, plugin_errors
from terrainkit_robots.checkpoint import check_state, open_checkpoint
from terrainkit_robots.rl.config import Task
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.run import PolicySpec, Run, last_checkpoint
from terrainkit_robots.rl.runner import runner_config

Policy = Callable[[TensorDict], torch.Tensor]


def load_policy(spec: PolicySpec, env: LeggedEnv) -> Policy:
    """Return a policy for `env`; see `load_actor` for the policy of a run.

    Args:
        spec: The policy: a run, or a function of the observations.
        env: The environment.

    Raises:
        ConfigError: If the spec has no policy, or its policy is for another robot or task.
    """
    if (policy := spec.policy) is not None:
        function = _Function(policy)
        if function.reset is not None:  # it may have the state of another evaluation
            function.reset(torch.ones(env.num_envs, dtype=torch.bool))
        return function
    if not isinstance(spec, Run):
        raise ConfigError("policy: got none; expected a run, or a function of the observations")
    return load_actor(spec, env)


class _Function:
    """A function of the policy's observations, as a policy."""

    def __init__(self, function: Callable[[Any], Any]) -> None:
        self.function, self.reset = function, getattr(function, "reset", None)

    def __call__(self, obs: TensorDict) -> torch.Tensor:
        return torch.as_tensor(self.function(obs["policy"]))


def load_actor(run: Run, env: LeggedEnv) -> MLPModel:
    """Return the actor network of a run: a deterministic policy for `env`, in evaluation mode.

    Raises:
        ConfigError: If the run has no checkpoint, or its checkpoint is for another robot or task.
    """
    obs_sizes = {"policy": env.obs_sizes["policy"]}  # the critic's do not matter
    with open_checkpoint(last_checkpoint(run), env.robot.spec.joint_order, obs_sizes) as state:
        actor = make_actor(run.task, env)
        check_state("actor_state_dict", state["actor_state_dict"], actor.state_dict())
        actor.load_state_dict(state["actor_state_dict"])
    return actor.to(env.device).eval()


def make_actor(task: Task, env: LeggedEnv) -> MLPModel:
    """Return a new network that acts: the actor, or the student of a distillation."""
    with plugin_errors("runner.rsl_rl" if task.runner.rsl_rl else None, TerrainkitError):
        runner = runner_config(task)
        name = "student" if "student" in runner else "actor"
        kind, config = resolve_class(runner[name])
        return kind(env.get_observations(), runner["obs_groups"], name, env.num_actions, **config)


@contextmanager
def single_torch_thread() -> Iterator[None]:
    """Limit torch to one thread, which is fastest for networks as small as these."""
    previous = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(previous)
