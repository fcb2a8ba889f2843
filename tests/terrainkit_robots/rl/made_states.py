from collections.abc import Mapping
from dataclasses import fields
from types import SimpleNamespace
from typing import Any

import numpy as np

from terrainkit_robots.rl.config import Task
from terrainkit_robots.rl.state import State
from terrainkit_robots.spec.robot_arrays import Robot

FLAGS = ("fallen",)

Shape = tuple[int, ...]


def shapes(*, joints: int, feet: int, penalized: int, points: int) -> dict[str, Shape]:
    """Return the shapes of the arrays of a state, for one robot."""
    vectors = "base_pos base_lin_vel base_ang_vel projected_gravity commands mean_vel"
    others: dict[str, Shape] = dict.fromkeys(vectors.split(), (3,))
    others |= dict.fromkeys(["base_height", "fallen"], ())
    of_feet = "swing_phase foot_height foot_height_over_edges foot_air_time"
    others |= dict.fromkeys(of_feet.split(), (feet,))
    others |= dict.fromkeys(["foot_vel", "foot_force"], (feet, 3))
    others |= {"foot_ground_depth": (feet, 5)}
    others |= {"base_quat": (4,), "gait_phase": (2,)}
    others |= {"penalized_force": (penalized,), "height_scan": (points,)}
    return {each.name: others.get(each.name, (joints,)) for each in fields(State)}


def made_state(of_one: Mapping[str, Shape], n: int, **arrays: Any) -> State:
    """Return a state of n robots that is 0 except for the given arrays."""
    made = {}
    for name, shape in of_one.items():
        made[name] = np.zeros((n, *shape), bool if name in FLAGS else np.float32)
        if name in arrays:
            made[name][...] = arrays.pop(name)
    assert not arrays, f"a state has no {list(arrays)}"
    return State(**made)


def made_env(
    robot: Robot, task: Task, of_one: Mapping[str, Shape], n: int, **arrays: Any
) -> SimpleNamespace:
    """Return what terms read of an environment of n robots that weigh 100 N.

    Arrays are 0 except for the given ones.
    """
    joints = of_one["dof_pos"]
    widths = {"joint_offset": joints, "push_vel": (3,), "obs_history": (0,)}
    widths["lin_vel_bias"] = (3,)
    params = {"friction": (1,), "added_mass": (1,), "com_shift": (3,)}
    made = {}
    for name, shape in (widths | params).items():
        made[name] = np.zeros((n, *shape), np.float32)
        made[name][...] = arrays.pop(name, 0)
    return SimpleNamespace(
        **{name: made[name] for name in widths},
        params=SimpleNamespace(**{name: made[name] for name in params}),
        state=made_state(of_one, n, **arrays),
        robot=robot,
        cfg=task,
        num_envs=n,
        mass=100 / 9.81,
        has_height_scan=True,
        has_velocity=True,
        history_length=task.observations.history_length or 1,
        scene=SimpleNamespace(joint_units=("rad",) * joints[0]),
    )
