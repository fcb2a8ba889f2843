"""The state of an environment in a checkpoint, from which training continues exactly."""

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit_robots.checkpoint import check_state
from terrainkit_robots.rl.events import apply_params

if TYPE_CHECKING:
    from terrainkit_robots.rl.env import LeggedEnv

_SHARED = ("velocity.lin_vel_x", "velocity.tracked", "velocity.steps")
"""Arrays that are the same for any number of environments."""


def env_arrays(env: "LeggedEnv") -> dict[str, NDArray[Any]]:
    """Return views of all arrays that change during training, by name."""
    tables: dict[str, Mapping[str, Any]] = {
        "sim": {"physics": env.sim.batch.state, "episode_length": env.episode_length_buf.numpy()},
        "rewards": env.episode_sums,
        "buffers": env.buffers,
        "stream": env.terrain.arrays,
    }
    if env.cfg.domain_rand.action_delay:
        tables["delay"] = {"actions": env.sim.batch.expand("actuator_delay")}
    # The state has means, accelerations and forces, which cannot be computed from the physics.
    owners = {"state": env.state, "params": env.params, "waypoints": env.waypoints}
    owners |= {"progress": env.curriculum.progress, "velocity": env.velocity_command}
    owners |= env.active_commands
    tables |= {name: vars(owner) for name, owner in owners.items() if owner}
    return {
        f"{table}.{name}": array
        for table, values in tables.items()
        for name, array in values.items()
        if isinstance(array, np.ndarray)
    }


def env_state(env: "LeggedEnv") -> dict[str, Any]:
    """Return all mutable state, for an exact resume."""
    return {
        "arrays": {name: torch.tensor(array) for name, array in env_arrays(env).items()},
        "rng": env.rng.bit_generator.state,
        "curriculum": env.curriculum.state_dict(),
        "observations": dict(env.get_observations().clone().items()),
    }


def load_env_state(env: "LeggedEnv", state: Mapping[str, Any]) -> None:
    """Restore a state; if the number of environments differs, restore only the curricula.

    Raises:
        ConfigError: If it belongs to another robot, task or map, or is damaged.
    """
    own = env_state(env)
    check_state("env", state, dict.fromkeys(own, ...))
    saved = state["arrays"]
    env.curriculum.load_state_dict(state["curriculum"])
    num_envs = len(state["curriculum"]["levels"])
    if num_envs != env.num_envs and num_envs == len(saved["sim.episode_length"]):
        check_state("env.arrays", saved, {name: own["arrays"][name] for name in _SHARED})
        _copy_arrays(env, saved, _SHARED)
        if "stream.episodes" in saved:  # no patch comes twice
            env.terrain.skip(int(saved["stream.episodes"].max()))
        env.reset()
        return
    try:
        check_state("env", state, own | {"curriculum": ...})
    except ConfigError as error:
        hint = "with another env.num_envs, the networks and the curriculum can be used"
        raise ConfigError(f"{error}; {hint}") from error
    for name, array in saved.items():  # a term may make its buffer when it is first called
        if name.startswith("buffers.") and name not in own["arrays"]:
            env.buffers[name.removeprefix("buffers.")] = torch.clone(array).numpy()
    _copy_arrays(env, saved, own["arrays"])
    env.terrain.restore()
    if env.waypoints and (env.waypoints.index > env.waypoints.numbers).any():
        largest = env.waypoints.index.max()
        raise ConfigError(f"next goal: got {largest}; expected no more than the robot has")
    apply_params(env.sim, env.params)
    env.rng.bit_generator.state = state["rng"]
    env.set_observations({name: state["observations"][name] for name in own["observations"]})


def _copy_arrays(env: "LeggedEnv", saved: Mapping[str, torch.Tensor], names: Iterable[str]) -> None:
    arrays = env_arrays(env)
    for name in names:
        arrays[name][...] = saved[name].numpy()
