from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from terrainkit_robots.rl.state import State

FLAGS = ("fallen",)

Shape = tuple[int, ...]


def shapes(*, joints: int, feet: int, penalized: int, points: int) -> dict[str, Shape]:
    """Return the shapes of the arrays of a state, for one robot."""
    vectors = "base_pos base_lin_vel base_ang_vel projected_gravity commands mean_vel push_vel"
    others = dict.fromkeys([*vectors.split(), "com_shift"], (3,))
    others |= dict.fromkeys(["base_height", "fallen"], ())
    others |= dict.fromkeys(["friction", "added_mass"], (1,))
    others |= dict.fromkeys(["swing_phase", "foot_height"], (feet,))
    others |= dict.fromkeys(["foot_vel", "foot_force"], (feet, 3))
    others |= {"base_quat": (4,), "gait_phase": (2,), "history": (0,)}
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
