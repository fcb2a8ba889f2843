"""The policy: the network that acts, read from a run's checkpoint."""

import warnings
from collections.abc import Callable

import torch
from rsl_rl.models import MLPModel
from tensordict import TensorDict

from terrainkit.errors import ConfigError, TerrainkitWarning
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.run import Run, changed_robot_files, read_checkpoint
from terrainkit_robots.rl.runner import OBS_GROUPS, actor_config, check_checkpoint, network_errors
from terrainkit_robots.rl.scene import SPEC_FILE

Act = Callable[[TensorDict], torch.Tensor]
"""From observations to actions."""


def policy_of(run: Run, env: LeggedEnv) -> Act:
    """Return the policy of a run: from observations of `env` to actions, always the same.

    Warns:
        TerrainkitWarning: if the robot's model is another by now.

    Raises:
        ConfigError: if the run has no checkpoint, or one of another robot or task.
    """
    actor = actor_of(run, env)

    def act(observations: TensorDict) -> torch.Tensor:
        with torch.inference_mode():
            return actor(observations.to(env.device)).clone()

    return act


def actor_of(run: Run, env: LeggedEnv) -> MLPModel:
    """Return the network of a run's policy, ready to be used; errors as `policy_of`."""
    if run.checkpoint is None:
        raise ConfigError(f"{run.folder} has no checkpoint yet; wanted a run that has been trained")
    # Of the spec, the run has its own.
    if files := [name for name in changed_robot_files(run) if name != SPEC_FILE]:
        other = f"{run.robot_name} has another {' and '.join(files)}"
        warnings.warn(
            f"{other} than {run.folder} was trained with",
            TerrainkitWarning,
            stacklevel=2,
        )
    state = read_checkpoint(run.checkpoint)
    check_checkpoint(run.checkpoint, state, env, OBS_GROUPS["actor"])
    with network_errors(run.checkpoint):
        actor = MLPModel(
            env.get_observations(), OBS_GROUPS, "actor", env.num_actions, **actor_config(run.task)
        )
        actor.load_state_dict(state["actor_state_dict"])
    return actor.to(env.device).eval()
