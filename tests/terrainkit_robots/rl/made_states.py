from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from terrainkit_robots.rl.state import State

FLAGS = ("fallen",)

Shape = tuple[int, ...]


def shapes(*, joints: int, feet: int, penalized: int, points: int) -> dict[str, Shape]:
    """Return the shapes of the arrays of a state, for one robot."""
    others = {
        "base_pos": (3,),
        "base_quat": (4,),
        "base_lin_vel": (3,),
        "base_ang_vel": (3,),
        "projected_gravity": (3,),
        "base_height": (),
        "commands": (3,),
        "gait_phase": (2,),
        "swing_phase": (feet,),
        "mean_vel": (3,),
        "foot_height": (feet,),
        "foot_vel": (feet, 3),
        "foot_force": (feet, 3),
        "penalized_force": (penalized,),
        "height_scan": (points,),
        "push_vel": (3,),
        "friction": (1,),
        "added_mass": (1,),
        "com_shift": (3,),
        "fallen": (),
        "history": (0,),
    }
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
