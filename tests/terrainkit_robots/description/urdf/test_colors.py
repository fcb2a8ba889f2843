from pathlib import Path

import pytest

from terrainkit_robots.description.load import load_robot

FILE = Path("/robots/robot.urdf")
BOX = '<geometry><box size="1 1 1"/></geometry>'


def visuals(inner):
    text = f'<robot name="r">{inner}</robot>'
    model = load_robot(FILE, contents={FILE: text.encode()})
    assert {problem.code for problem in model.problems} <= {"XML016"}  # undefined materials
    return [visual.color for link in model.links for visual in link.visuals]


def visual(material):
    return f"<visual>{BOX}{material}</visual>"


def link(*materials):
    return f'<link name="l{abs(hash(materials))}">{"".join(map(visual, materials))}</link>'


def color(rgba):
    return f'<material name="m"><color rgba="{rgba}"/></material>'


def test_color_of_visual():
    assert visuals(link(color("1 0.5 0 0.25"))) == [(1, 0.5, 0, 0.25)]


def test_color_of_named_material():
    named = '<material name="m"/>'
    assert visuals(link(named) + color("0 0 1 1")) == [(0, 0, 1, 1)]
    assert visuals(link(named) + link(color("0 1 0 1"))) == [(0, 1, 0, 1)] * 2


def test_precedence_of_materials():
    text = link('<material name="m"/>') + link(color("0 1 0 1")) + color("0 0 1 1")
    assert visuals(text + color("1 0 0 1")) == [(0, 0, 1, 1), (0, 1, 0, 1)]


@pytest.mark.parametrize(
    "rgba",
    ["1 1 1", "1 1 1 1 1", "a b c d", "nan 0 0 1", "inf 0 0 1", "-0.1 0 0 1", "255 0 0 1", ""],
)
def test_invalid_color(rgba):
    assert visuals(link(color(rgba))) == [None]


@pytest.mark.parametrize(
    "material",
    [
        "",
        '<material name="m"/>',
        "<material/>",
        '<material name="m"><color/></material>',
        '<material name="m"><texture filename="wood.png"/></material>',
        '<material><color/></material><!-- --><contact_coefficients mu="1"/>',
    ],
)
def test_no_color(material):
    assert visuals(link(material) + '<material><color rgba="1 0 0 1"/></material>') == [None]


def test_collisions_have_no_color():
    text = f'<robot name="r"><link name="l"><collision>{BOX}{color("1 0 0 1")}</collision></link>'
    model = load_robot(FILE, contents={FILE: f"{text}</robot>".encode()})
    assert model.links[0].collisions[0].color is None
