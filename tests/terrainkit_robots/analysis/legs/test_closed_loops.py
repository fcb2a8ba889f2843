import math

import pytest

from terrainkit_robots.analysis.legs.closed_loops import close_loops
from tests.small_robots import mjcf

# A lever of 0.2 m below the origin, and a strut from (0.15, 0, 0) to its end: a 3-4-5 triangle.
STRUT = f"""
<body name="trunk"><freejoint/><geom size="0.05"/>
  <body name="lever"><joint name="hip" axis="0 1 0"/><geom size="0.01" pos="0 0 -0.2"/>
    <site name="end" pos="0 0 -0.2"/>
  </body>
  <body name="tube" pos="0.15 0 0" euler="0 {math.degrees(math.asin(0.6))} 0">
    <joint name="swing" axis="0 1 0"/><geom size="0.01"/>
    <body name="rod" pos="0 0 -0.2">
      <joint name="slide" type="slide" axis="0 0 -1" range="-0.2 {{reach}}"/><geom size="0.01"/>
      <site name="tip" pos="0 0 -0.05"/>
    </body>
  </body>
</body>
"""
CONNECTIONS = (
    '<connect body1="lever" body2="rod" anchor="0 0 -0.2"/>',
    '<connect site1="tip" site2="end"/>',
    '<weld body1="lever" body2="rod" anchor="0 0 -0.05"/>',
)


def closed(connection, hip, reach=0.2):
    robot = mjcf(STRUT.format(reach=reach), f"<equality>{connection}</equality>")
    given = {"hip": hip, "swing": 0.0, "slide": 0.0}
    return close_loops(robot, given, legs={"hip"}, actuated=()), given


@pytest.mark.parametrize("connection", CONNECTIONS)
def test_strut_follows_the_lever(connection):
    # A quarter turn takes the end of the lever to (-0.2, 0, 0), 0.35 m from the strut's hinge.
    positions, _ = closed(connection, math.pi / 2)
    swing = math.pi / 2 - math.asin(0.6)
    assert positions == pytest.approx({"hip": math.pi / 2, "swing": swing, "slide": 0.1}, abs=1e-4)


def test_leg_moves_where_the_strut_is_too_short():
    positions, _ = closed(CONNECTIONS[0], math.pi / 2, 0.05)
    assert positions["slide"] <= 0.05
    # The law of cosines in the triangle of the two hinges and the end of the lever.
    squared = 0.15**2 + 0.2**2 + 2 * 0.15 * 0.2 * math.sin(positions["hip"])
    assert (0.25 + positions["slide"]) ** 2 == pytest.approx(squared, abs=1e-5)


def test_loops_that_cannot_be_closed_change_nothing():
    positions, given = closed('<connect body1="trunk" body2="rod" anchor="9 0 0"/>', 0.3)
    assert positions == given
