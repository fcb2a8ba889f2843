"""Rules that compare the order of joints and actuators."""

from collections.abc import Sequence

import numpy as np

from terrainkit_robots.analysis.bodies.permutation import is_reordered, permutation
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.lint.rule import Part, Severity, Violation, Violations, rule
from terrainkit_robots.lint.rules.xrf.other_robot import (
    joint_pairs,
    other_name,
    other_robot,
    robot_pairs,
)
from terrainkit_robots.text import names


@rule("XRF004", "joint-order-differs", "warning", needs=("against",))
def compare_joint_order(robot: Facts) -> Violations:
    """The order of the joints differs between the files.

    Simulators number joints in the order of the file. The actions and observations of a policy
    trained on one file then silently belong to other joints of the other file.

    Fix:
        Permute actions and observations with the lists in the message, or reorder one of the files.

    Source:
        The order is depth first in the tree, with siblings as in the file, which is MuJoCo's order
        for both formats.
    """
    pairs, other, there = joint_pairs(robot), other_robot(robot), other_name(robot)
    ours = {one.name: two.name for one, two in pairs}
    theirs = [joint.name for joint in other.joints if joint.name in ours.values()]
    indices = permutation(list(ours.values()), theirs)
    if indices is None or not is_reordered(indices):
        return
    subset = len(pairs) < max(len(robot.joints), len(other.joints))
    yield Violation(
        message=f"order of the {f'{len(pairs)} common ' if subset else ''}joints: got "
        f"{names(ours, max_count=4)} here and {names(theirs, max_count=4)} in {there}; "
        f"{_format_order('theirs', 'ours', indices)}",
        measured={"permutation": str(indices), "back": str(_inverse(indices))},
    )


def _format_order(target: str, source: str, indices: Sequence[int]) -> str:
    """Return a permutation and its inverse as two expressions that can be pasted into code."""
    inverse = _inverse(indices)
    return f"{target} = {source}[{list(indices)}] and {source} = {target}[{inverse}]"


def _inverse(indices: Sequence[int]) -> list[int]:
    return [int(index) for index in np.argsort(indices)]


@rule("XRF005", "actuator-order-differs", "warning", needs=("against",))
def compare_actuator_order(robot: Facts) -> Violations:
    """The actuators of an MJCF file have another order than its joints.

    Controls are ordered by actuator, positions by joint. Actions in the order of the joints, as in
    a URDF, drive the wrong joints.

    Fix:
        Permute actions with the lists in the message, or reorder the actuators.

    Source:
        MuJoCo: `ctrl` has the order of <actuator>, `qpos` the order of the bodies. In Unitree's
        MJCF of Go2 the right legs come first in the actuators and last in the joints.
    """
    other, there = other_robot(robot), other_name(robot)
    partner = dict(robot_pairs(robot).joint_names.pairs)
    ours = [partner[name] for name in robot.actuator_order if name in partner]
    theirs = other.actuator_order
    common = [name for name in theirs if name in ours]
    indices = permutation([name for name in ours if name in common], common)
    within = [
        f"actuator order of {file}: got another order than its joints; {difference}"
        for file, difference in (
            ("this file", _actuator_difference(robot)),
            (there, _actuator_difference(other)),
        )
        if difference
    ]
    if not common:  # at most one of the files is an MJCF with actuators
        yield from (_report_actuators(robot, message) for message in within)
    elif indices and is_reordered(indices):
        between = (
            f"actuator order: got another order than in {there}; "
            f"{_format_order('theirs', 'ours', indices)}"
        )
        yield _report_actuators(robot, "; ".join([between, *within]))
    elif within:
        yield _report_actuators(robot, "; ".join(["both files agree", *within]), "note")


def _actuator_difference(robot: Facts) -> str:
    """Return the permutation between the actuators and joints of a file; empty if they agree."""
    actuated = robot.actuator_order
    joints = [joint.name for joint in robot.joints if joint.name in actuated]
    indices = permutation(joints, actuated)
    if indices is None or not is_reordered(indices):
        return ""
    return (
        f"{_format_order('ctrl', 'joints', indices)}, where joints has the order "
        f"{names(joints, max_count=4)} and ctrl the order {names(actuated, max_count=4)}"
    )


def _report_actuators(robot: Facts, message: str, severity: Severity | None = None) -> Violation:
    source = next((actuator.source for actuator in robot.model.actuators), robot.model.source)
    part = Part(robot.model.title, source)
    return Violation(element=part, message=message, severity=severity)
