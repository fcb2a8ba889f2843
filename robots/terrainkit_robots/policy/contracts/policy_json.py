"""`policy.json`, terrainkit's own description of a policy."""

from collections.abc import Iterator, Mapping
from math import isclose
from typing import Any

import msgspec
import numpy as np

from terrainkit.errors import ConfigError, ExportError, listing
from terrainkit_robots.policy.contracts.contract import (
    COMMAND_NAMES,
    FORMATS,
    TERM_NAMES,
    Contract,
    ContractTerm,
)
from terrainkit_robots.rl.config import Terrain

JSON_FILE, METADATA_KEY = "policy.json", "terrainkit"
"""Name of the file, and the key of its content in the metadata of an ONNX file."""

_COMPARED = "format_version timing observation action control_type joints feet gait height_scan"
"""Keys that state what the policy receives and what its actions do."""

_OF_THE_ROBOT = ("joints.frictionloss", "joints.passive_damping")
"""Keys that may differ between the robot and the robot of the training."""


class _Required(msgspec.Struct):
    joints: dict[str, list[str | float | bool | None]]
    task: dict[str, Any] = {}


def read_policy_json(data: bytes) -> dict[str, Any]:
    """Return the content of `policy.json`, which has lists of `joints`, and the table `task`.

    Raises:
        ConfigError: If it is not JSON, or has no joints.
    """
    try:
        document = msgspec.json.decode(data, type=dict[str, Any])
        return document | msgspec.structs.asdict(msgspec.convert(document, _Required))
    except (msgspec.DecodeError, UnicodeError, RecursionError) as error:
        raise ConfigError(str(error)) from error


def check_policy_json(document: Mapping[str, Any], built: Mapping[str, Any]) -> None:
    """Check that a description agrees with the environment of its task and joints.

    Args:
        document: The content of `policy.json`.
        built: The description of a policy in that environment.

    Raises:
        ConfigError: If a value differs.
    """
    got, expected = (
        table.get("robot", {}).get("center", [0.0, 0.0, 0.0]) for table in (document, built)
    )
    if not np.allclose(got, expected, atol=1e-4):
        raise ConfigError(f"robot.center: got {got}; expected {expected}, the middle of the feet")
    for key in _COMPARED.split():
        expected = dict(_leaves(built[key], key))
        for place, got in _leaves(document.get(key, {}), key):
            if place.startswith(_OF_THE_ROBOT) or _is_close(got, expected.get(place, ...)):
                continue
            other = "the environment of task and joints has no such value"
            if place in expected:
                other = f"expected {expected[place]}, as in task and joints"
            raise ConfigError(f"{place}: got {str(got)[:80]}; {other}")


def _leaves(value: Any, path: str) -> Iterator[tuple[str, Any]]:
    """Yield the path and the value of each number, text and null in a value of JSON."""
    if not isinstance(value, dict | list):
        yield path, value
        return
    for key, item in value.items() if isinstance(value, dict) else enumerate(value):
        yield from _leaves(item, f"{path}.{key}")


def _is_close(got: Any, built: Any) -> bool:
    numbers = isinstance(got, int | float) and isinstance(built, int | float)
    try:
        return isclose(got, built, rel_tol=1e-5, abs_tol=1e-6) if numbers else bool(got == built)
    except OverflowError:  # an integer beyond the range of float
        return False


def to_contract(document: Mapping[str, Any], style: int) -> Contract:
    """Return the contract of an exported policy in another format's names.

    Args:
        document: The content of `policy.json`.
        style: The format: `UNITREE` or `MJLAB`.

    Raises:
        ExportError: If a reader of that format would misread the policy.
    """
    joints, action, scan = document["joints"], document["action"], document["height_scan"]
    control = document["control_type"]
    default = Terrain()
    points = (scan or {}).get("points")
    parts = document["observation"]["parts"]
    center = document.get("robot", {}).get("center", ())  # none in files of version 0.1
    names = [part["name"] for part in parts]
    of_center = [name for name in names if name in ("base_lin_vel", "height_scan")]
    grid = [[x, y] for x in default.measured_points_x for y in default.measured_points_y]
    for name, got, is_expressible, expected in (
        ("control.control_type", control, control == "P", "P: positions"),
        ("wheels", "velocity targets", "velocity" not in joints["drive"], "position targets"),
        ("action_scale", "joints without an action", action["joints"] == joints["name"], "none"),
        ("runner.rsl_rl", "a recurrent network", not document.get("recurrent"), "a network"),
        (listing(of_center), "of robot.center", not (any(center) and of_center), "of the frame"),
        ("terrain.measured_points", "another grid", points in (None, grid), "the default grid"),
    ):
        if not is_expressible:
            raise ExportError(f"{FORMATS[style]}: {name}: got {got}; expected {expected}")
    terms = []
    for part in parts:
        name, offset = part["name"], part["offset"]
        is_pose = name == "dof_pos" and offset == joints["default_position"]
        if any(offset) and not is_pose and name != "height_scan":
            raise ExportError(f"{FORMATS[style]}: offset of {name}: got {offset}; expected 0")
        params = {"offset": offset[0]} if name == "height_scan" else {}
        if name == "gait_phase":
            params = {key: document["gait"][key] for key in ("period", "min_yaw_rate")}
        term = ContractTerm(
            name=TERM_NAMES.get(name, (name, name))[style],
            scale=tuple(part["scale"]),
            clip=tuple(part["clip"]) if "clip" in part else None,
            history=part["history"],
            params=params,
        )
        terms.append(term)
    commands = document["task"]["commands"]
    return Contract(
        style=style,
        joints=tuple(joints["name"]),
        default_pose=tuple(joints["default_position"]),
        stiffness=tuple(joints["stiffness"]),
        damping=tuple(joints["damping"]),
        action_scale=tuple(joints["action_scale"]),
        action_offset=tuple(joints["action_offset"]),
        terms=tuple(terms),
        step_dt=document["timing"]["policy_dt"],
        physics_dt=document["timing"]["physics_dt"],
        commands={name: tuple(commands[key]) for name, key in COMMAND_NAMES.items()},
    )
