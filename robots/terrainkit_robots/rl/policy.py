"""The networks of a policy: their configuration, and checks of a checkpoint against them."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from terrainkit.errors import ConfigError, listing
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.task import Task

GROUPS = {"actor": ["policy"], "critic": ["privileged"]}
"""Which observations each network sees."""


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
