import pytest

from tests.tables import read_table
from tests.terrainkit_robots.description.made_robots import mjcf, read

LEG = """<body name="{0}"><joint name="{0}0"/><geom size="0.1"/>
<body name="{0}_end"><joint name="{0}1"/><geom size="0.1"/><site name="{0}"/></body></body>"""
UNNAMED = '<body><joint name="tail"/><geom size="0.1"/></body>'
TRUNK = f'<body name="a"><freejoint/><geom size="0.1"/>{{}}{{}}{UNNAMED}</body>'


@pytest.mark.parametrize(("rest", "coupled"), read_table(__file__, "joints_of_a_loop_are_coupled"))
def test_joints_of_a_loop_are_coupled(rest, coupled):
    inside = TRUNK.format(LEG.format("l"), LEG.format("r"))
    robot = read(mjcf(inside, f"<equality>{rest}</equality>"))
    assert [joint.name for joint in robot.joints if joint.coupled] == coupled.split()


def test_joints_of_a_fixed_tendon_are_coupled():
    tendon = (
        '<tendon><fixed><joint joint="l1" coef="1"/><joint joint="r0" coef="2"/></fixed></tendon>'
    )
    robot = read(mjcf(TRUNK.format(LEG.format("l"), LEG.format("r")), tendon))
    assert [joint.name for joint in robot.joints if joint.coupled] == ["l1", "r0"]
