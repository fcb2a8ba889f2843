from pathlib import Path

import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.inertia.placeholder import placeholder_inertias
from terrainkit_robots.description.load import load_robot

FILE = Path("/robots/robot.urdf")


def placeholders(*links):
    """Return the names of links with placeholders in a chain of (mass, moments, side)."""
    text = ""
    for k, (mass, (ixx, iyy, izz), side) in enumerate(links):
        text += (
            f'<link name="{k}"><inertial><mass value="{mass}"/><inertia ixx="{ixx}" iyy="{iyy}" '
            f'izz="{izz}" ixy="0" ixz="0" iyz="0"/></inertial>'
            f'<collision><geometry><box size="{side} 1 1"/></geometry></collision></link>'
        )
        if k:
            text += (
                f'<joint name="joint_{k}" type="continuous"><parent link="{k - 1}"/>'
                f'<child link="{k}"/><origin xyz="0 0 1"/></joint>'
            )
    robot = load_robot(FILE, contents={FILE: f'<robot name="r">{text}</robot>'.encode()})
    found = placeholder_inertias(Facts(robot).bodies)
    return [[link.name for link in members] for _, members in found]


ROUND, EXACT, OTHER = (0.01, 0.02, 0.02), (0.01234, 0.0234, 0.0234), (0.3, 0.3, 0.4)


def test_identity_is_a_placeholder_even_once():
    assert placeholders((1, (1, 1, 1), 1), (2, OTHER, 2)) == [["0"]]
    assert placeholders((1, (1, 1, 1.001), 1), (2, OTHER, 2)) == []


@pytest.mark.parametrize(
    ("equal", "others", "is_found"),
    [(2, 0, False), (3, 0, True), (3, 3, True), (3, 4, False), (4, 4, True)],
)
def test_equal_inertias_of_three_and_half_of_the_links_are_placeholders(equal, others, is_found):
    links = [(1, ROUND, k + 1) for k in range(equal)]
    links += [(1, (0.3 + k, 0.3 + k, 0.4 + k), 1) for k in range(others)]
    assert placeholders(*links) == ([[str(k) for k in range(equal)]] if is_found else [])


def test_copies_of_one_part_are_no_placeholders():
    assert placeholders(*[(1, ROUND, 1)] * 3) == []  # of the same shape
    assert placeholders(*[(1, EXACT, k + 1) for k in range(3)]) == []  # of the same mass, exact
    assert placeholders(*[(k + 1, EXACT, k + 1) for k in range(3)]) == [["0", "1", "2"]]
    sphere = (0.01234, 0.01234, 0.01234)
    assert placeholders(*[(1, sphere, k + 1) for k in range(3)]) == [["0", "1", "2"]]


def test_links_without_mass_or_inertia_are_no_placeholders():
    assert placeholders(*[(0, ROUND, k + 1) for k in range(3)]) == []
    assert placeholders(*[(1, (0, 0, 0), k + 1) for k in range(3)]) == []
