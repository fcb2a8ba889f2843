"""Defects of joints."""

import numpy as np

from defects.patient import Patient, Subjects, kind, limit, mirrored, numbers, put, shift


@kind("JNT001", "error", "a joint of a type that is not known")
def unknown_type(robot: Patient) -> Subjects:
    joint = robot.choose(robot.moving())
    joint.set("type", robot.choose(["revolut", "hinge", "Revolute", "rotary"]))
    return [joint.get("name")]


@kind("JNT001 XML013", "error", "a joint without a type")
def no_type(robot: Patient) -> Subjects:
    joint = robot.choose(robot.moving())
    del joint.attrib["type"]
    return [joint.get("name")]


@kind("JNT002", "warning", "a leg joint that slides")
def prismatic(robot: Patient) -> Subjects:
    joint = robot.choose(robot.leg_joints())
    joint.set("type", "prismatic")
    return [joint.get("name")]


@kind("JNT003", "warning", "a leg joint without end")
def continuous(robot: Patient) -> Subjects:
    joint = robot.choose(robot.leg_joints())
    joint.set("type", "continuous")
    for name in ("lower", "upper"):
        del limit(joint).attrib[name]
    return [joint.get("name")]


@kind("JNT004", "error", "an axis of zeros")
def zero_axis(robot: Patient) -> Subjects:
    joint = robot.choose(robot.moving())
    joint.find("axis").set("xyz", robot.choose(["0 0 0", "0.0 0.0 0.0", "1e-20 0 0"]))
    return [joint.get("name")]


@kind("JNT005", "warning", "an axis that is not of length 1")
def long_axis(robot: Patient) -> Subjects:
    joint = robot.choose(robot.moving())
    axis = joint.find("axis")
    put(axis, "xyz", numbers(axis, "xyz") * robot.choose([0.5, 2.0, 100.0, 0.9]))
    return [joint.get("name")]


@kind("JNT005", "warning", "an axis along a diagonal, not of length 1")
def diagonal_axis(robot: Patient) -> Subjects:
    joint = robot.choose(robot.leg_joints())
    axis = joint.find("axis")
    shift(axis, "xyz", [0.03, 0.03, 0.03])
    return [joint.get("name")]


@kind("JNT006", "error", "no limit")
def no_limit(robot: Patient) -> Subjects:
    joint = robot.choose(robot.moving())
    joint.remove(limit(joint))
    return [joint.get("name")]


@kind("JNT006", "error", "a limit of zero to zero")
def empty_limit(robot: Patient) -> Subjects:
    joint = robot.choose(robot.moving())
    where = robot.choose([0.0, float(limit(joint).get("upper"))])
    for name in ("lower", "upper"):
        limit(joint).set(name, f"{where:g}")
    return [joint.get("name")]


@kind("JNT006", "error", "a limit without a range")
def unbounded_limit(robot: Patient) -> Subjects:
    joint = robot.choose(robot.moving())
    for name in ("lower", "upper"):
        del limit(joint).attrib[name]
    return [joint.get("name")]


@kind("JNT007", "error", "the lower limit above the upper")
def swapped_limits(robot: Patient) -> Subjects:
    joint = robot.choose(robot.moving())
    element = limit(joint)
    lower, upper = element.get("lower"), element.get("upper")
    element.set("lower", upper)
    element.set("upper", lower)
    return [joint.get("name")]


@kind("JNT008", "warning", "limits in degrees")
def degrees(robot: Patient) -> Subjects:
    joint = robot.choose(robot.leg_joints())
    for name in ("lower", "upper"):
        limit(joint).set(name, f"{np.degrees(float(limit(joint).get(name))):.4g}")
    return [joint.get("name")]


@kind("JNT008", "warning", "a placeholder for limits")
def placeholder_limits(robot: Patient) -> Subjects:
    joint = robot.choose(robot.moving())
    size = robot.choose(["1000", "1e6", "100", "31.4"])
    limit(joint).set("lower", f"-{size}")
    limit(joint).set("upper", size)
    return [joint.get("name")]


@kind("JNT009", "error", "an effort of zero")
def no_effort(robot: Patient) -> Subjects:
    joint = robot.choose(robot.moving())
    limit(joint).set("effort", robot.choose(["0", "0.0"]))
    return [joint.get("name")]


@kind("JNT009 XML013", "warning", "no effort")
def effort_missing(robot: Patient) -> Subjects:
    joint = robot.choose(robot.moving())
    del limit(joint).attrib["effort"]
    return [joint.get("name")]


@kind("JNT010", "warning", "a speed of zero")
def no_velocity(robot: Patient) -> Subjects:
    joint = robot.choose(robot.moving())
    limit(joint).set("velocity", "0")
    return [joint.get("name")]


@kind("JNT010 XML013", "warning", "no speed")
def velocity_missing(robot: Patient) -> Subjects:
    joint = robot.choose(robot.moving())
    del limit(joint).attrib["velocity"]
    return [joint.get("name")]


@kind("JNT011", "warning", "a placeholder for effort")
def huge_effort(robot: Patient) -> Subjects:
    joint = robot.choose(robot.moving())
    limit(joint).set("effort", robot.choose(["1000", "10000", "1e6"]))
    return [joint.get("name")]


@kind("JNT011", "warning", "a placeholder for speed")
def huge_velocity(robot: Patient) -> Subjects:
    joint = robot.choose(robot.moving())
    limit(joint).set("velocity", robot.choose(["1000", "999", "1e5"]))
    return [joint.get("name")]


@kind("JNT012", "info", "limits that leave zero out")
def zero_outside(robot: Patient) -> Subjects:
    joint = robot.choose(
        j
        for j in robot.leg_joints()
        if float(limit(j).get("lower")) < 0 < float(limit(j).get("upper")) - 0.3
    )
    limit(joint).set("lower", "0.1")
    return [joint.get("name")]


@kind("JNT013", "error", "a mimic of a joint that is not there")
def mimic_of_nothing(robot: Patient) -> Subjects:
    joint = robot.choose(robot.moving())
    joint.append(joint.makeelement("mimic", joint="lost_joint"))
    return [joint.get("name"), "lost_joint"]


@kind("JNT013", "error", "two joints that mimic each other")
def mimic_cycle(robot: Patient) -> Subjects:
    one, other = robot.rng.sample(robot.moving(), 2)
    one.append(one.makeelement("mimic", joint=other.get("name")))
    other.append(other.makeelement("mimic", joint=one.get("name")))
    return [one.get("name"), other.get("name")]


@kind("JNT013", "error", "a joint that mimics itself")
def mimic_of_itself(robot: Patient) -> Subjects:
    joint = robot.choose(robot.moving())
    joint.append(joint.makeelement("mimic", joint=joint.get("name"), multiplier="-1"))
    return [joint.get("name")]


@kind("JNT014", "info", "a safety controller with a gain")
def safety_controller(robot: Patient) -> Subjects:
    joint = robot.choose(robot.moving())
    attributes = {"k_position": "100", "k_velocity": "10"}
    joint.append(joint.makeelement("safety_controller", attributes))
    return [joint.get("name")]


@kind("JNT015", "error", "knees too weak to stand")
def weak_knees(robot: Patient) -> Subjects:
    knee = robot.choose(robot.knees())
    part = knee.get("name")
    for prefix in ("FL_", "FR_", "RL_", "RR_", "left_", "right_"):
        part = part.removeprefix(prefix)
    weak = [joint for joint in robot.knees() if joint.get("name").endswith(part)]
    for joint in weak:
        limit(joint).set("effort", robot.choose(["0.3", "0.5", "1"]) if joint is knee else "0.4")
    return [joint.get("name") for joint in weak]


@kind("JNT015", "error", "one knee too weak to stand")
def weak_knee(robot: Patient) -> Subjects:
    knee = robot.choose(robot.knees())
    limit(knee).set("effort", "0.5")
    return mirrored(knee.get("name"))
