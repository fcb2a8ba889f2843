"""Load policies: the checkpoint of a run, or a function."""

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import torch
from rsl_rl.models import MLPModel
from tensordict import TensorDict

from terrainkit.errors import ConfigError, TerrainkitWarning
from terrainkit_robots.checkpoint import check_state, open_checkpoint
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.run import PolicySpec, Run, changed_robot_files, last_checkpoint
from terrainkit_robots.rl.runner import OBS_GROUPS, runner_config
from terrainkit_robots.spec.robot import SPEC_FILE

Policy = Callable[[TensorDict], torch.Tensor]


def load_policy(spec: PolicySpec, env: LeggedEnv) -> Policy:
    """Return a policy for `env`; see :func:`load_actor` for the policy of a run.

    Args:
        spec: The policy: a run, or a function of the observations.
        env: The environment.

    Raises:
        ConfigError: If the spec has no policy, or its policy is for another robot or task.
    """
    if (policy := spec.policy) is not None:
        return lambda obs: torch.as_tensor(policy(obs["policy"]))
    if not isinstance(spec, Run):
        raise ConfigError("policy: got none; expected a run, or a function of the observations")
    return load_actor(spec, env)


def load_actor(run: Run, env: LeggedEnv) -> MLPModel:
    """Return the actor network of a run: a deterministic policy for `env`, in evaluation mode.

    Warns:
        TerrainkitWarning: If the robot's model changed after training.

    Raises:
        ConfigError: If the run has no checkpoint, or its checkpoint is for another robot or task.
    """
    # The run has its own copy of the spec, so only a change of the model matters.
    if files := [name for name in changed_robot_files(run) if name != SPEC_FILE]:
        message = f"{run.info.robot}: {' and '.join(files)} changed after {run.folder} was trained"
        warnings.warn(message, TerrainkitWarning, stacklevel=2)
    obs_sizes = {"policy": env.obs_sizes["policy"]}  # the critic's do not matter
    with open_checkpoint(last_checkpoint(run), env.robot.spec.joint_order, obs_sizes) as state:
        config = runner_config(run.task)["actor"]
        config.pop("class_name")
        actor = MLPModel(env.get_observations(), OBS_GROUPS, "actor", env.num_actions, **config)
        check_state("actor_state_dict", state["actor_state_dict"], actor.state_dict())
        actor.load_state_dict(state["actor_state_dict"])
    return actor.to(env.device).eval()


@contextmanager
def single_torch_thread() -> Iterator[None]:
    """Limit torch to one thread, which is fastest for networks as small as these."""
    previous = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(previous)
