import math

import pytest

from terrainkit_robots.simulation.joint_sweep import joint_sweep
from terrainkit_robots.simulation.sim_model import make_sim_model

CRANE = """
<robot name="crane">
  <link name="mast">
    <collision><origin xyz="0 0.5 0"/><geometry><box size="1 0.02 0.2"/></geometry></collision>
  </link>
  <link name="turntable">
    <inertial><mass value="1"/>
      <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="lift" type="revolute">
    <parent link="mast"/><child link="turntable"/><axis xyz="1 0 0"/>
    <limit lower="-0.1" upper="0.1" effort="10" velocity="10"/>
  </joint>
  <link name="boom">
    <inertial><origin xyz="0.6 0 0"/><mass value="3"/>
      <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision>
      <origin xyz="0.6 0 0"/><geometry><sphere radius="0.01"/></geometry>
    </collision>
  </link>
  <joint name="swing" type="revolute">
    <parent link="turntable"/><child link="boom"/><axis xyz="0 0 1"/>
    <limit lower="-1.5" upper="1.5" effort="10" velocity="10"/>
  </joint>
  <link name="hook">
    <inertial><origin xyz="0.2 0 0"/><mass value="0.5"/>
      <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="hook_joint" type="revolute">
    <parent link="boom"/><child link="hook"/><origin xyz="0.6 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="2" effort="10" velocity="10"/>
  </joint>
</robot>
"""


@pytest.fixture
def sweep(robot):
    """Return a function that sweeps the joints of a robot in a text, by name."""
    return lambda text: {each.joint: each for each in joint_sweep(make_sim_model(robot(text)))}


@pytest.fixture
def crane(sweep):
    return sweep(CRANE)


def test_joint_sweep_stops_at_collision(crane):
    swing = crane["swing"]
    # The tip has a radius of 0.6 m, and the wall is at y = 0.49: contact from asin(0.48 / 0.6) on.
    assert swing.reached[1] == pytest.approx(math.asin(0.48 / 0.6), abs=3 / 40)
    assert swing.reached[0] == pytest.approx(-1.5)
    assert swing.blocked[0] is None
    assert set(swing.blocked[1]) == {"mast", "boom"}
    assert swing.share == pytest.approx((swing.reached[1] + 1.5) / 3)


def test_joint_sweep_measures_gravity_load(crane):
    hook = crane["hook_joint"]
    load = pytest.approx(0.5 * 9.81 * 0.2)
    assert (hook.load, hook.max_load, hook.effort, hook.share) == (load, load, 10, 1)
    assert crane["swing"].max_load == pytest.approx(0, abs=1e-9)


def test_joint_sweep_follows_actuator_order(bundled):
    sim = make_sim_model(bundled("biped.urdf"))
    results = joint_sweep(sim)
    assert tuple(result.joint for result in results) == sim.actuated
    assert results == joint_sweep(sim)
    for result in results:
        assert result.limits[0] <= result.reached[0] <= result.reached[1] <= result.limits[1]
        assert result.load < result.effort


def test_joint_sweep_is_symmetric(bundled):
    results = {r.joint: r for r in joint_sweep(make_sim_model(bundled("quadruped.urdf")))}
    left, right = results["FL_hip_joint"], results["FR_hip_joint"]
    assert left.reached[0] == pytest.approx(-right.reached[1], abs=1e-9)
    assert left.share < 0.9  # the feet meet under the trunk
    assert set(left.blocked[0]) == {"FL_foot", "FR_foot"}


def test_joint_sweep_moves_mimic_joints(sweep):
    text = CRANE.replace(
        '<parent link="boom"/><child link="hook"/>',
        '<mimic joint="swing" multiplier="0.5"/><parent link="boom"/><child link="hook"/>',
    )
    results = sweep(text)
    assert set(results) == {"lift", "swing"}
    assert results["swing"].share < 1
