from pathlib import Path

import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot

FILE = Path("/robots/robot.urdf")


def arm(side, y, **changed):
    """Return an arm of two links that is mounted at `y`."""
    given = {"mass": 2, "center": 0.1, "ixx": 0.01, "length": 0.3, "upper": 1, "radius": 0.05}
    given |= changed
    text = ""
    for k, (parent, xyz) in enumerate((("trunk", f"0 {y} 0"), (f"{side}_0", "0.3 0 0.1"))):
        origin = xyz.replace("0.3", str(given["length"]))
        text += (
            f'<link name="{side}_{k}"><inertial><origin xyz="0 {given["center"]} 0"/>'
            f'<mass value="{given["mass"]}"/><inertia ixx="{given["ixx"]}" iyy="0.02" izz="0.02" '
            'ixy="0" ixz="0" iyz="0"/></inertial><collision><geometry>'
            f'<sphere radius="{given["radius"]}"/></geometry></collision></link>'
            f'<joint name="{side}_joint_{k}" type="revolute"><parent link="{parent}"/>'
            f'<child link="{side}_{k}"/><origin xyz="{origin}"/><axis xyz="0 1 0"/>'
            f'<limit lower="-1" upper="{given["upper"]}" effort="9" velocity="5"/></joint>'
        )
    return text


def copies(**changed):
    text = f'<link name="trunk"/>{arm("left", 0.2)}{arm("right", -0.2, **changed)}'
    robot = load_robot(FILE, contents={FILE: f'<robot name="r">{text}</robot>'.encode()})
    return [pair.left.body.name for pair in Facts(robot).copied_pairs]


def test_equal_arms_are_copies_wherever_they_are_mounted():
    assert copies() == ["left_0", "left_1"]


@pytest.mark.parametrize(
    ("name", "rounded", "other"),
    [
        ("mass", 2.0019, 2.01),
        ("center", 0.10009, 0.1002),
        ("ixx", 0.010019, 0.01003),  # 0.001 of the largest moment
        ("length", 0.30009, 0.3002),
    ],
)
def test_arms_that_differ_by_more_than_rounding_are_no_copies(name, rounded, other):
    assert copies(**{name: rounded}) == ["left_0", "left_1"]
    assert copies(**{name: other}) == []


@pytest.mark.parametrize(("name", "value"), [("upper", 1.1), ("radius", 0.06)])
def test_arms_with_other_limits_or_shapes_are_no_copies(name, value):
    assert copies(**{name: value}) == []
