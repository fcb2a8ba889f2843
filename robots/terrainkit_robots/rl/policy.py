"""The policy: the network that acts, read from a run's checkpoint."""

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch
from rsl_rl.models import MLPModel
from tensordict import TensorDict

from terrainkit.errors import ConfigError, TerrainkitWarning, listing
from terrainkit_robots.rl.checkpoint import read_checkpoint
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.robot import SPEC_FILE
from terrainkit_robots.rl.run_folder import Run, changed_robot
from terrainkit_robots.rl.task import Task

Act = Callable[[TensorDict], torch.Tensor]
"""From observations to actions."""

GROUPS = {"actor": ["policy"], "critic": ["privileged"]}
"""Which observations each network sees."""


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
    if files := [name for name in changed_robot(run) if name != SPEC_FILE]:
        other = f"{run.robot_name} has another {' and '.join(files)}"
        warnings.warn(
            f"{other} than {run.folder} was trained with",
            TerrainkitWarning,
            stacklevel=2,
        )
    state = read_checkpoint(run.checkpoint)
    refuse_other(run.checkpoint, state, env, GROUPS["actor"])
    with fitting(run.checkpoint):
        actor = MLPModel(
            env.get_observations(), GROUPS, "actor", env.num_actions, **actor_config(run.task)
        )
        actor.load_state_dict(state["actor_state_dict"])
    return actor.to(env.device).eval()


def refuse_other(
    path: Path, state: Mapping[str, Any], env: LeggedEnv, groups: Sequence[str]
) -> None:
    """Refuse a checkpoint of another robot, or of a task whose groups are of another size."""
    joints = list(env.robot.spec.joint_order)
    if state["joints"] != joints:
        raise ConfigError(
            f"{path} is of another robot, {state['robot']}, whose joints are: "
            f"{listing(map(str, state['joints']))}; wanted: {listing(joints)}"
        )
    wanted = widths(env)
    for name in groups:
        if state["observed"].get(name) != wanted[name]:
            raise ConfigError(
                f"{path} is of another task: its observations {name} are "
                f"{state['observed'].get(name)} numbers; here they are {wanted[name]}; one that is "
                "to go from a plane to a map has terrain.measure_heights on both"
            )


def widths(env: LeggedEnv) -> dict[str, int]:
    """Return how many numbers each group of observations has."""
    return {name: values.shape[1] for name, values in env.get_observations().items()}


@contextmanager
def fitting(path: Path) -> Iterator[None]:
    """Turn torch's reasons why weights do not fit into one line."""
    try:
        yield
    except ConfigError:
        raise
    except (RuntimeError, ValueError, LookupError, TypeError, AttributeError) as error:
        reason = " ".join(str(error).split())[:200]
        raise ConfigError(f"{path} does not fit the networks of its task: {reason}") from error


def actor_config(task: Task) -> dict[str, Any]:
    """Return what rsl-rl wants to know of the network that acts."""
    policy = task.policy
    return {
        "hidden_dims": list(policy.actor_hidden_dims),
        "activation": policy.activation,
        "obs_normalization": policy.obs_normalization,
        "distribution_cfg": {
            "class_name": "GaussianDistribution",
            "init_std": policy.init_noise_std,
            "std_type": "scalar",
        },
    }
