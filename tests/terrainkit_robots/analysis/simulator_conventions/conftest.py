"""Small trees of links."""

import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot

INERTIAL = (
    '<inertial><mass value="1"/>'
    '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
)
SPHERE = '<collision><geometry><sphere radius="0.01"/></geometry></collision>'


@pytest.fixture
def urdf(tmp_path):
    """Return facts of a URDF of joints `name: parent > child`; `!` is fixed, `*` is kept."""

    def make(*joints, extra=""):
        links: dict[str, None] = {}
        parts = []
        for each in joints:
            name, _, ends = each.partition(": ")
            parent, _, child = ends.partition(" > ")
            links |= dict.fromkeys([parent, child])
            kept = ' dont_collapse="true"' if "*" in name else ""
            kind = "fixed" if name.strip("*").endswith("!") else "revolute"
            parts.append(
                f'<joint name="{name.strip("!*")}" type="{kind}"{kept}>'
                f'<parent link="{parent}"/><child link="{child}"/><axis xyz="0 0 1"/>'
                '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
            )
        bodies = "".join(f'<link name="{name}">{INERTIAL}{SPHERE}</link>' for name in links)
        path = tmp_path / "robot.urdf"
        path.write_text(f'<robot name="r">{extra}{bodies}{"".join(parts)}</robot>')
        return Facts(load_robot(path))

    return make


@pytest.fixture
def mjcf(tmp_path):
    """Return facts of an MJCF whose world body has the given bodies."""

    def make(bodies):
        path = tmp_path / "robot.xml"
        path.write_text(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")
        return Facts(load_robot(path))

    return make
