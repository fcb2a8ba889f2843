"""Load the policy of a run."""

import warnings

from rsl_rl.models import MLPModel

from terrainkit.errors import ConfigError, TerrainkitWarning
from terrainkit_robots.rl.checkpoint import read_checkpoint
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.policy import GROUPS, actor_config, fitting, refuse_other
from terrainkit_robots.rl.robot import SPEC_FILE
from terrainkit_robots.rl.run_folder import Run, changed_robot


def load_policy(run: Run, env: LeggedEnv) -> MLPModel:
    """Return the actor network of a run: a deterministic policy in evaluation mode.

    Args:
        run: A run with a checkpoint.
        env: The environment that the policy acts in.

    Warns:
        TerrainkitWarning: if the robot's model changed after training.

    Raises:
        ConfigError: if the run has no checkpoint, or one of another robot or task.
    """
    if run.checkpoint is None:
        raise ConfigError(f"run {run.folder}: got no checkpoint; expected a trained run")
    # The run has its own copy of the spec, so only a change of the model matters.
    if files := [name for name in changed_robot(run) if name != SPEC_FILE]:
        changed = f"{' and '.join(files)} of {run.robot_name} changed"
        message = f"{changed} after the run {run.folder} was trained"
        warnings.warn(message, TerrainkitWarning, stacklevel=2)
    state = read_checkpoint(run.checkpoint)
    refuse_other(run.checkpoint, state, env, GROUPS["actor"])
    with fitting(run.checkpoint):
        obs, config = env.get_observations(), actor_config(run.task)
        actor = MLPModel(obs, GROUPS, "actor", env.num_actions, **config)
        actor.load_state_dict(state["actor_state_dict"])
    return actor.to(env.device).eval()
