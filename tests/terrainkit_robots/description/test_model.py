from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from terrainkit_robots.description.model import Dynamics, Geometry, Joint, Limit, RobotModel, Source
from tests.tables import read_table

SOURCE = Source(file=Path("robot.urdf"), line=1)
JOINT = Joint(name="j", source=SOURCE, kind="revolute", parent="a", child="b")


@pytest.mark.parametrize(
    ("kind", "moves", "units"),
    [
        ("revolute", True, ("rad", "N m", "rad/s")),
        ("continuous", True, ("rad", "N m", "rad/s")),
        ("prismatic", True, ("m", "N", "m/s")),
        ("ball", False, ("rad", "N m", "rad/s")),
    ],
)
def test_joint_units(kind, moves, units):
    joint = replace(JOINT, kind=kind)
    found = joint.unit, joint.units.effort, joint.units.velocity
    assert (joint.moves, found) == (moves, units)


@pytest.mark.parametrize(
    ("kind", "ends", "wanted"),
    [
        ("revolute", (-1.0, 2.0), (-1.0, 2.0)),
        ("prismatic", (0.0, 1e-9), (0.0, 1e-9)),
        ("continuous", (-1.0, 2.0), None),
        ("revolute", (1.0, 1.0), None),
        ("revolute", (2.0, 1.0), None),
        ("revolute", (None, 1.0), None),
        ("revolute", (1.0, None), None),
    ],
)
def test_range_has_both_limits_in_order(kind, ends, wanted):
    limit = Limit(source=SOURCE, lower=ends[0], upper=ends[1])
    assert replace(JOINT, kind=kind, limit=limit).range == wanted
    assert replace(JOINT, kind=kind).range is None


@pytest.mark.parametrize(("axis", "wanted"), read_table(__file__, "direction_is_x_unless_the_axis"))
def test_direction_is_x_unless_the_axis_has_a_length(axis, wanted):
    with np.errstate(over="ignore"):
        assert replace(JOINT, axis=np.array(axis)).direction == pytest.approx(wanted)


def test_missing_values_of_joint():
    limit = Limit(source=SOURCE, effort=3.0, velocity=4.0)
    dynamics = Dynamics(source=SOURCE, damping=1.0)
    full = replace(JOINT, limit=limit, dynamics=dynamics)
    assert (full.effort, full.velocity, full.damping, full.friction) == (3, 4, 1, 0)
    assert (JOINT.effort, JOINT.velocity, JOINT.damping, JOINT.friction) == (None, None, 0, 0)
    assert (JOINT.origin.tolist(), JOINT.anchor.tolist()) == (np.eye(4).tolist(), [0, 0, 0])


@pytest.mark.parametrize(("bits", "wanted"), [((0, 0), False), ((2, 0), True), ((0, 4), True)])
def test_geometry_contacts_anything(bits, wanted):
    shape = Geometry(source=SOURCE, shape="sphere", contype=bits[0], conaffinity=bits[1])
    assert shape.contacts is wanted


def test_title_is_name_of_robot_or_file():
    model = RobotModel(name="", kind="urdf", file=Path("a/robot.urdf"), source=SOURCE)
    assert (model.title, replace(model, name="dog").title) == ("robot.urdf", "dog")
