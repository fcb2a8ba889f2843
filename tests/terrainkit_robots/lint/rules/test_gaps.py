import numpy as np
import pytest

from terrainkit_robots.lint.rules.tre.gaps import _gaps

HINGE = """<robot name="r"><link name="a"/><link name="b"/>
<joint name="j" type="continuous"><parent link="a"/><child link="b"/>
<origin xyz="{x} 5 0"/><axis xyz="0 1 0"/></joint></robot>"""


@pytest.mark.parametrize(("x", "distance"), [(0, 0), (0.25, 0.15), (-1, 0.9)])
def test_distance_of_the_axis_from_the_closer_box(robot, x, distance):
    box, far = np.array([[-0.1] * 3, [0.1] * 3]), np.array([[-0.1, -0.1, 3], [0.1, 0.1, 4]])
    (body,) = robot(HINGE.format(x=x)).bodies[1:]
    assert _gaps(body, far, box) == pytest.approx((2.9, distance), abs=0.01)
