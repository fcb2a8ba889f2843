import pytest

from tests.terrainkit_robots.description.made_robots import mjcf, read

LEG = """<body name="{0}"><joint name="{0}0"/><geom size="0.1"/>
<body name="{0}_end"><joint name="{0}1"/><geom size="0.1"/><site name="{0}"/></body></body>"""
UNNAMED = '<body><joint name="tail"/><geom size="0.1"/></body>'
TRUNK = f'<body name="a"><freejoint/><geom size="0.1"/>{{}}{{}}{UNNAMED}</body>'


@pytest.mark.parametrize(
    ("rest", "coupled"),
    [
        ('<connect body1="l_end" body2="r_end" anchor="0 0 0"/>', "l0 l1 r0 r1"),
        ('<weld body1="l" body2="r_end"/>', "l0 r0 r1"),
        ('<weld body1="l" body2="l_end"/>', "l1"),
        ('<connect site1="l" site2="r"/>', "l0 l1 r0 r1"),  # not the bodies of these names
        ('<connect body1="l_end" body2="r_end" anchor="0 0 0" active="false"/>', ""),
        ('<connect body1="l_end" anchor="0 0 0"/>', ""),  # held by the world
        ('<joint joint1="l0" joint2="r0"/>', ""),
    ],
)
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
