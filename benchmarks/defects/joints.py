"""Defects of joints (JNT)."""

import numpy as np

from defects.mutant import (
    Mutant,
    Subjects,
    add_offset,
    limit,
    mirror_names,
    mutation,
    numbers,
    set_numbers,
)


@mutation("JNT001", "error", "unknown joint type")
def unknown_type(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.actuated_joints())
    joint.set("type", robot.pick(["revolut", "hinge", "Revolute", "rotary"]))
    return [joint.get("name")]


@mutation("JNT001 XML013", "error", "joint without type")
def no_type(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.actuated_joints())
    del joint.attrib["type"]
    return [joint.get("name")]


@mutation("JNT002", "warning", "prismatic leg joint")
def sliding_leg_joint(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.leg_joints())
    joint.set("type", "prismatic")
    return [joint.get("name")]


@mutation("JNT003", "warning", "continuous leg joint")
def endless_leg_joint(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.leg_joints())
    joint.set("type", "continuous")
    for name in ("lower", "upper"):
        del limit(joint).attrib[name]
    return [joint.get("name")]


@mutation("JNT004", "error", "zero axis")
def zero_axis(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.actuated_joints())
    joint.find("axis").set("xyz", robot.pick(["0 0 0", "0.0 0.0 0.0", "1e-20 0 0"]))
    return [joint.get("name")]


@mutation("JNT005", "warning", "axis that is not a unit vector")
def axis_length(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.actuated_joints())
    axis = joint.find("axis")
    set_numbers(axis, "xyz", numbers(axis, "xyz") * robot.pick([0.5, 2.0, 100.0, 0.9]))
    return [joint.get("name")]


@mutation("JNT005", "warning", "diagonal axis that is not a unit vector")
def diagonal_axis(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.leg_joints())
    axis = joint.find("axis")
    add_offset(axis, "xyz", [0.03, 0.03, 0.03])
    return [joint.get("name")]


@mutation("JNT006", "error", "joint without limit")
def no_limit(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.actuated_joints())
    joint.remove(limit(joint))
    return [joint.get("name")]


@mutation("JNT006", "error", "lower limit equal to upper limit")
def empty_range(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.actuated_joints())
    where = robot.pick([0.0, float(limit(joint).get("upper"))])
    for name in ("lower", "upper"):
        limit(joint).set(name, f"{where:g}")
    return [joint.get("name")]


@mutation("JNT006", "error", "limit without lower and upper")
def no_range(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.actuated_joints())
    for name in ("lower", "upper"):
        del limit(joint).attrib[name]
    return [joint.get("name")]


@mutation("JNT007", "error", "lower limit above upper limit")
def swapped_limits(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.actuated_joints())
    element = limit(joint)
    lower, upper = element.get("lower"), element.get("upper")
    element.set("lower", upper)
    element.set("upper", lower)
    return [joint.get("name")]


@mutation("JNT008", "warning", "limits in degrees")
def degrees(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.leg_joints())
    for name in ("lower", "upper"):
        limit(joint).set(name, f"{np.degrees(float(limit(joint).get(name))):.4g}")
    return [joint.get("name")]


@mutation("JNT008", "warning", "placeholder limits")
def placeholder_limits(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.actuated_joints())
    size = robot.pick(["1000", "1e6", "100", "31.4"])
    limit(joint).set("lower", f"-{size}")
    limit(joint).set("upper", size)
    return [joint.get("name")]


@mutation("JNT009", "error", "effort of zero")
def zero_effort(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.actuated_joints())
    limit(joint).set("effort", robot.pick(["0", "0.0"]))
    return [joint.get("name")]


@mutation("JNT009 XML013", "warning", "missing effort")
def missing_effort(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.actuated_joints())
    del limit(joint).attrib["effort"]
    return [joint.get("name")]


@mutation("JNT010", "warning", "velocity of zero")
def zero_velocity(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.actuated_joints())
    limit(joint).set("velocity", "0")
    return [joint.get("name")]


@mutation("JNT010 XML013", "warning", "missing velocity")
def missing_velocity(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.actuated_joints())
    del limit(joint).attrib["velocity"]
    return [joint.get("name")]


@mutation("JNT011", "warning", "placeholder effort")
def placeholder_effort(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.actuated_joints())
    limit(joint).set("effort", robot.pick(["1000", "10000", "1e6"]))
    return [joint.get("name")]


@mutation("JNT011", "warning", "placeholder velocity")
def placeholder_velocity(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.actuated_joints())
    limit(joint).set("velocity", robot.pick(["1000", "999", "1e5"]))
    return [joint.get("name")]


@mutation("JNT012", "info", "limits that exclude zero")
def zero_out_of_limits(robot: Mutant) -> Subjects:
    joint = robot.pick(
        j
        for j in robot.leg_joints()
        if float(limit(j).get("lower")) < 0 < float(limit(j).get("upper")) - 0.3
    )
    limit(joint).set("lower", "0.1")
    return [joint.get("name")]


@mutation("JNT013", "error", "mimic of an unknown joint")
def unknown_mimic(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.actuated_joints())
    joint.append(joint.makeelement("mimic", joint="lost_joint"))
    return [joint.get("name"), "lost_joint"]


@mutation("JNT013", "error", "two joints that mimic each other")
def mimic_cycle(robot: Mutant) -> Subjects:
    one, other = robot.rng.sample(robot.actuated_joints(), 2)
    one.append(one.makeelement("mimic", joint=other.get("name")))
    other.append(other.makeelement("mimic", joint=one.get("name")))
    return [one.get("name"), other.get("name")]


@mutation("JNT013", "error", "joint that mimics itself")
def self_mimic(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.actuated_joints())
    joint.append(joint.makeelement("mimic", joint=joint.get("name"), multiplier="-1"))
    return [joint.get("name")]


@mutation("JNT014", "info", "safety controller with a gain")
def safety_controller(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.actuated_joints())
    attributes = {"k_position": "100", "k_velocity": "10"}
    joint.append(joint.makeelement("safety_controller", attributes))
    return [joint.get("name")]


@mutation("JNT015", "error", "all knees with insufficient effort")
def weak_knee_joints(robot: Mutant) -> Subjects:
    knee = robot.pick(robot.knee_joints())
    part = knee.get("name")
    for prefix in ("FL_", "FR_", "RL_", "RR_", "left_", "right_"):
        part = part.removeprefix(prefix)
    weak = [joint for joint in robot.knee_joints() if joint.get("name").endswith(part)]
    for joint in weak:
        limit(joint).set("effort", robot.pick(["0.3", "0.5", "1"]) if joint is knee else "0.4")
    return [joint.get("name") for joint in weak]


@mutation("JNT015", "error", "one knee with insufficient effort")
def weak_knee(robot: Mutant) -> Subjects:
    knee = robot.pick(robot.knee_joints())
    limit(knee).set("effort", "0.5")
    return mirror_names(knee.get("name"))
