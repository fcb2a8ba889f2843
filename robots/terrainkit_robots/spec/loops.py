"""Closed loops that a spec adds to a robot, whose file is a tree."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from terrainkit.errors import ConfigError, prefixed_errors
from terrainkit.settings.schema import Config
from terrainkit.settings.text import expected_names, truncate
from terrainkit.settings.toml_text import parse_toml, read_text
from terrainkit_robots.description.loops import MAX_LOOPS, make_loop, move_into_plane, with_loops
from terrainkit_robots.description.model import Actuator, Loop, RobotModel
from terrainkit_robots.spec.robot_spec import ClosedLoop, Names, RobotSpec


@dataclass(frozen=True, kw_only=True)
class LoopSpec(Config):
    """The part of a spec that changes the robot: a file may have only this, to derive the rest."""

    loops: tuple[ClosedLoop, ...] = ()
    """Loops that the file of the robot cannot have."""

    joint_order: Names = ()
    """The joints with a motor; none: as the file of the robot says."""


def load_spec(path: str | Path) -> tuple[RobotSpec | None, LoopSpec]:
    """Return the spec of a file, which is None if the file has only loops, and its loops.

    Raises:
        ConfigError: if the file cannot be read, or is invalid.
    """
    text = read_text(path)
    with prefixed_errors(f"{path}: "):
        table = parse_toml(text)
        if "loops" in table and table.keys() <= {"loops", "joint_order"}:
            return None, LoopSpec.from_table(table)
        spec = RobotSpec.from_toml(text)
    return spec, LoopSpec(loops=spec.loops, joint_order=spec.joint_order)


def with_loop_spec(model: RobotModel, given: LoopSpec) -> RobotModel:
    """Return a robot with the loops and motors of a spec, if it has loops.

    They replace loops of the file. An MJCF keeps its own, since it says more about them.

    Raises:
        ConfigError: if the loops do not fit the robot.
    """
    if not given.loops or not model.links or (model.kind == "mjcf" and model.loops):
        return model
    if model.kind == "mjcf":
        raise ConfigError("loops: got an MJCF without loops; expected <equality> in that file")
    if len(given.loops) > MAX_LOOPS:
        raise ConfigError(f"loops: got {len(given.loops)}; expected at most {MAX_LOOPS}")
    loops = [_loop(number, loop, model) for number, loop in enumerate(given.loops, 1)]
    joints = {joint.name: joint for joint in model.joints if joint.moves and joint.mimic is None}
    for name in given.joint_order:
        if name not in joints:
            expected = expected_names(name, joints, "expected joints of")
            raise ConfigError(f"joint_order: got {truncate(name)}; {expected}")
    actuators = tuple(
        Actuator(name=name, source=joints[name].source, joint=name, effort=joints[name].effort)
        for name in given.joint_order
    )
    return replace(with_loops(model, loops), actuators=actuators)


def _loop(number: int, loop: ClosedLoop, model: RobotModel) -> Loop:
    """Return a loop of a robot, or raise ConfigError."""
    frame = np.eye(4)
    frame[:3, 3] = loop.anchor
    with prefixed_errors(f"loop {number}: "):
        made = make_loop(model, number, loop.kind, loop.links, (loop.links[0], frame))
    if loop.other_anchor is not None:
        made.origins[1][:3, 3] = loop.other_anchor
        move_into_plane(made, model.joints)
    return made


def closed_loops(model: RobotModel) -> tuple[ClosedLoop, ...]:
    """Return the loops of a robot as a spec has them."""
    return tuple(
        ClosedLoop(
            links=loop.links,
            anchor=_point(loop.origins[0]),
            other_anchor=_point(loop.origins[1]),
            kind=loop.kind,
        )
        for loop in model.loops
    )


def _point(pose: "np.ndarray") -> tuple[float, float, float]:
    x, y, z = (pose[:3, 3].round(6) + 0.0).tolist()
    return x, y, z
