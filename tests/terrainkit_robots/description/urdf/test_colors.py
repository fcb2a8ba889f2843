from pathlib import Path

import pytest

from tests.terrainkit_robots.description import made_robots
from tests.terrainkit_robots.description.made_robots import codes

BOX = '<geometry><box size="1 1 1"/></geometry>'
NAMED = '<material name="m"/>'
RED, GREEN, BLUE = (1, 0, 0, 1), (0, 1, 0, 1), (0, 0, 1, 1)


def read(inner):
    return made_robots.read(f'<robot name="r">{inner}</robot>', Path("robot.urdf"))


def link(material, name="l"):
    return f'<link name="{name}"><visual>{BOX}{material}</visual></link>'


def color(rgba, name="m"):
    words = rgba if isinstance(rgba, str) else " ".join(map(str, rgba))
    return f'<material name="{name}"><color rgba="{words}"/></material>'


@pytest.mark.parametrize(
    ("inner", "wanted"),
    [
        (link(color("1 0.5 0 0.25")), [(1, 0.5, 0, 0.25)]),
        (link(NAMED) + color(BLUE), [BLUE]),
        (link(NAMED) + color(BLUE, " m "), [BLUE]),
        (link(NAMED) + link(color(GREEN)), [GREEN, GREEN]),
        (link(NAMED) + link(color(GREEN)) + color(BLUE) + color(RED), [BLUE, GREEN]),
        (link(NAMED) + color("x") + color(BLUE), [BLUE]),  # the first that is a color
        (link(color("1 1 1")), [None]),
        (link(color("1 1 1 1 1")), [None]),
        (link(color("nan 0 0 1")), [None]),
        (link(color("-0.1 0 0 1")), [None]),
        (link(color("1.1 0 0 1")), [None]),
        (link(color("")), [None]),
        (link(color("x")) + color(BLUE), [None]),  # its own is invalid
        (link("") + color(RED, ""), [None]),
        (link("<material/>") + color(RED, ""), [None]),
        (link('<material name="m"><color/></material>') + color(RED), [None]),
    ],
)
def test_color_of_visual(inner, wanted):
    assert [visual.color for each in read(inner).links for visual in each.visuals] == wanted


def test_collisions_have_no_color():
    model = read(f'<link name="l"><collision>{BOX}{color(RED)}</collision></link>')
    assert model.links[0].collisions[0].color is None


@pytest.mark.parametrize(
    ("inner", "found"),
    [
        (link(NAMED) * 2, ["XML016"]),
        (link(NAMED) + color("x"), []),
        (link(NAMED) + link('<material name="m"><texture filename="a.png"/></material>'), []),
        (link("<material/>"), []),
        (link('<material name="${x}"/>'), ["XML004"]),
    ],
)
def test_undefined_materials_are_reported_once(inner, found):
    assert codes(read(inner)) == found
