from pathlib import Path

import pytest

from terrainkit_robots.description.model import Joint, Source


@pytest.mark.parametrize(
    ("kind", "units"),
    [
        ("revolute", ("rad", "N m", "rad/s")),
        ("continuous", ("rad", "N m", "rad/s")),
        ("prismatic", ("m", "N", "m/s")),
    ],
)
def test_joint_units(kind, units):
    source = Source(file=Path("robot.urdf"), line=1)
    joint = Joint(name="j", source=source, kind=kind, parent="a", child="b")
    assert (joint.unit, joint.effort_unit, joint.speed_unit) == units
