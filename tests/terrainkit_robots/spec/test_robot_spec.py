import re
from dataclasses import fields

import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit_robots.spec.robot_spec import JOINT_TABLES, Provenance, RobotSpec, Twin, unit_of


def test_every_number_has_a_unit():
    for field in fields(RobotSpec):
        numeric = "float" in str(field.type)
        assert bool(unit_of(field.name)) == numeric, field.name


def test_tables_by_joint():
    assert JOINT_TABLES == (
        "default_pose",
        "stiffness",
        "damping",
        "effort",
        "velocity",
        "armature",
        "action_scale",
    )


def test_values_are_those_of_the_field(spec):
    made = spec(
        joint_order=["b"], stiffness={"b": 3}, reset_range=[0, 2], spawn_height=np.float64(1)
    )
    assert made.joint_order == ("b",)
    assert made.stiffness == {"b": 3.0}
    assert type(made.stiffness["b"]) is float
    assert made.reset_range == (0.0, 2.0)
    assert type(made.spawn_height) is float


def test_per_joint_is_in_the_order_of_the_joints(spec):
    made = spec(joint_order=("b", "a"), stiffness={"[ab]": 7})
    assert list(made.per_joint("stiffness").items()) == [("b", 7.0), ("a", 7.0)]
    with pytest.raises(ConfigError, match="no table by joint 'soft_limits'; there are: default_"):
        made.per_joint("soft_limits")
    with pytest.raises(ConfigError, match="joint b is matched by no key of damping"):
        spec(damping={"a": 1.0}).per_joint("damping")


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"stiffness": {"FL_hip_joint": -1}}, "stiffness.FL_hip_joint is -1; wanted 0 or more N m"),
        ({"stiffness": {"a.b": float("nan")}}, 'stiffness."a.b" is nan; wanted 0 or more N m/rad'),
        ({"damping": {"a": float("inf")}}, "damping.a is inf; wanted 0 or more N m s/rad or N s/m"),
        ({"effort": {"a": "1"}}, "effort.a is '1'; wanted a number"),
        ({"effort": {"a": 0}}, "effort.a is 0; wanted more than 0 N m or N"),
        ({"effort": {"a": True}}, "effort.a is True; wanted a number"),
        (
            {"effort": {"a": {"b": 1}}},
            "effort.a is a table; wanted more than 0 N m or N, a name with",
        ),
        ({"effort": 3}, "effort is 3; wanted a table"),
        ({"effort": {"": 3}}, "a key of effort is ''; wanted a name"),
        ({"default_pose": {"a": 1e400}}, "default_pose.a is inf; wanted a finite number rad or m"),
        ({"soft_limits": {"a": [1, 0]}}, "soft_limits.a is [1.0, 0.0]; wanted the lower number"),
        ({"soft_limits": {"a": [1]}}, "soft_limits.a has 1 values; wanted 2"),
        ({"soft_limits": {"a": 1}}, "soft_limits.a is 1; wanted a list"),
        ({"reset_range": (-1, 1)}, "reset_range is -1; wanted 0 or more"),
        ({"foot_radius": -0.1}, "foot_radius is -0.1; wanted 0 or more m"),
        ({"spawn_height": float("nan")}, "spawn_height is nan; wanted a finite number m"),
        ({"spawn_height": {}}, "spawn_height is a table; wanted a finite number m"),
        ({"name": ""}, "name is ''; wanted a name"),
        ({"name": 3}, "name is 3; wanted a text"),
        ({"urdf": "a\0b"}, "urdf is 'a\\x00b'; wanted text without NUL"),
        ({"base": "\ud800"}, "wanted text without NUL and lone surrogates"),
        ({"floating": 1}, "floating is 1; wanted true or false"),
        ({"joint_order": ("a", "a")}, "joint_order has 'a' twice; wanted each name once"),
        ({"joint_order": "ab"}, "joint_order is 'ab'; wanted a list"),
        ({"feet": ("a", "")}, "feet is ''; wanted a name"),
        ({"mirror": {"a": "b"}}, "mirror.a is 'b'; wanted Twin"),
        ({"provenance": {"x": Provenance(origin="solved")}}, "provenance has 'x'; wanted one of:"),
        ({"provenance": {"x.a": Provenance(origin="solved")}}, "provenance has 'x.a'; wanted one"),
    ],
)
def test_a_wrong_value_is_named(spec, changed, message):
    with pytest.raises(ConfigError, match=re.escape(message)):
        spec(**changed)


def test_origins_and_signs_are_checked():
    with pytest.raises(ConfigError, match="origin is 'guessed'; wanted one of: declared, measured"):
        Provenance(origin="guessed")
    with pytest.raises(ConfigError, match="reason is 3; wanted a text"):
        Provenance(origin="solved", reason=3)
    with pytest.raises(ConfigError, match="sign is 0; wanted 1 or -1"):
        Twin(joint="a", sign=0)
    with pytest.raises(ConfigError, match="joint is None; wanted a text"):
        Twin(joint=None, sign=1)
