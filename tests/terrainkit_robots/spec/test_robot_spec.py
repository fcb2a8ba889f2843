import re
from dataclasses import fields

import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit_robots.spec.robot_spec import (
    JOINT_TABLES,
    MirrorJoint,
    Provenance,
    RobotSpec,
    unit_of,
)
from tests.tables import read_table

SOLVED = Provenance(origin="solved")


def test_unit_of_is_given_for_every_number():
    for field in fields(RobotSpec):
        numeric = "float" in str(field.type)
        assert bool(unit_of(field.name)) == numeric, field.name


def test_joint_tables_are_those_of_numbers():
    assert " ".join(JOINT_TABLES) == (
        "default_pose stiffness damping effort velocity armature action_scale"
    )


def test_values_are_converted(spec):
    given = {"joint_order": ["b"], "stiffness": {"b": 3}, "reset_range": [0, 2]}
    made = spec(**given, spawn_height=np.float64(1))
    assert (made.joint_order, made.stiffness, made.reset_range) == (("b",), {"b": 3.0}, (0.0, 2.0))
    assert type(made.stiffness["b"]) is type(made.spawn_height) is float


def test_per_joint_keeps_the_joint_order(spec):
    made = spec(joint_order=("b", "a"), stiffness={"a": 6, "b": 7})
    assert list(made.per_joint("stiffness").items()) == [("b", 7.0), ("a", 6.0)]
    assert made.joint_array("stiffness").tolist() == [7.0, 6.0]
    with pytest.raises(ConfigError, match="no table by joint 'soft_limits'; there are: default_"):
        made.per_joint("soft_limits")
    with pytest.raises(ConfigError, match="joint b is matched by no key of damping"):
        spec(damping={"a": 1.0}).per_joint("damping")


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        *read_table(__file__, "invalid_value_is_named"),
        ({"base": "\ud800"}, "expected a non-empty string"),
        ({"provenance": {"x": SOLVED}}, "provenance: got 'x'; expected"),
    ],
)
def test_invalid_value_is_named(spec, changed, message):
    with pytest.raises(ConfigError, match=re.escape(message)):
        spec(**changed)


@pytest.mark.parametrize(
    ("kind", "values", "message"),
    [
        (Provenance, {"origin": "guessed"}, "origin: got 'guessed'; expected one of: declar"),
        (Provenance, {"origin": "solved", "reason": 3}, "reason: got 3; expected a string"),
        (MirrorJoint, {"joint": "a", "sign": 0}, "sign: got 0; expected one of: 1, -1"),
        (MirrorJoint, {"joint": None, "sign": 1}, "joint: got None; expected a non-empty string"),
    ],
)
def test_provenance_and_mirror_are_validated(kind, values, message):
    with pytest.raises(ConfigError, match=message):
        kind(**values)


@pytest.mark.parametrize(
    ("a", "b", "message"),
    [
        (("b", 1), ("a", 1), ""),
        (("a", -1), ("b", 1), ""),
        (("b", 1), ("a", -1), "a is paired with b; symmetry expects a joint that is paired with a"),
        (("b", 1), ("b", 1), "mirror of robot: a is paired with b"),
        (("a", 1), ("c", 1), "b is paired with c"),
        (("a", 1), None, "b is paired with nothing"),
    ],
)
def test_mirror_joints_are_paired(spec, a, b, message):
    pairs = {"a": a, "b": b, "c": ("b", 1)}
    mirror = {name: MirrorJoint(joint=p[0], sign=p[1]) for name, p in pairs.items() if p}
    made = spec(mirror=mirror)
    if message:
        with pytest.raises(ConfigError, match=message):
            made.mirror_joints()
    else:
        assert made.mirror_joints() == [mirror["a"], mirror["b"]]
