import pytest

from terrainkit_robots.simulation.declared_gains import declared_gains, standing_gains
from terrainkit_robots.simulation.pd_gains import suggest_gains
from terrainkit_robots.simulation.sim_model import make_sim_model
from terrainkit_robots.simulation.time_step import joint_inertia
from tests.tables import read_table

PENDULUM = read_table(__file__, "pendulum")
"""Two joints of 0.01 kg m2 about vertical axes on a fixed base."""


@pytest.fixture
def pendulum(robot):
    def load(a, b, damping=0):
        return robot(PENDULUM.format(a=a, b=b, damping=damping))

    return load


def test_declared_gains_are_used(pendulum):
    facts = pendulum('kp="9" kv="0.5"', 'kp="9" kv="0.5"')
    gain = standing_gains(facts)["a"]
    assert (gain.stiffness, gain.damping, gain.declared) == (9, 0.5, True)
    suggested = suggest_gains(facts)["a"]
    assert f"suggested are {suggested.stiffness:g} and {suggested.damping:g}" in gain.reason


# Critical damping of 0.01 kg m2 at 9 N m/rad is 2 sqrt(0.09) = 0.6 N m s/rad.
@pytest.mark.parametrize(("gains", "damping", "expected"), read_table(__file__, "declared_damping"))
def test_declared_damping(pendulum, gains, damping, expected):
    found = declared_gains(pendulum(gains, gains, damping)).gains["a"]
    assert found.damping == pytest.approx(expected)


# With an inertia I, damping is stable below 2 I / h = 0.02 / 0.005 = 4 N m s/rad.
@pytest.mark.parametrize(("kv", "used"), [(3.9, True), (4.1, False)])
def test_unstable_gains_are_not_used(pendulum, kv, used):
    facts = pendulum(f'kp="9" kv="{kv}"', 'kp="9" kv="0.5"')
    gains = standing_gains(facts)
    assert (gains["a"].declared, gains["b"].declared) == (used, True)
    unused = declared_gains(facts).unused
    assert list(unused) == ([] if used else ["a"])
    assert used or "stable up to a time step of 4.8" in unused["a"]


def test_joints_with_equal_gains_are_judged_together(pendulum):
    facts = pendulum('kp="9" kv="4.1"', 'kp="9" kv="4.1"')
    assert list(declared_gains(facts).unused) == ["a", "b"]


@pytest.mark.parametrize(("share", "used"), [(0.98, False), (1.02, True)])
def test_gains_that_are_too_slow_to_balance_are_not_used(bundled, tmp_path, share, used):
    def biped(kp):
        motors = ("<motor name", f'<position kp="{kp:.9g}" kv="1" name')
        return bundled("biped.xml", motors, tmp_path=tmp_path)

    facts = biped(1.0)
    inertia = joint_inertia(make_sim_model(facts))
    lightest = min(inertia[joint.name].free for joint in facts.leg_joints)
    length = sum(leg.length for leg in facts.legs) / 2
    slowest = 2.4**2 * 9.81 / length * lightest  # 80 % of 3 sqrt(g / leg length)
    unused = declared_gains(biped(share * slowest)).unused
    assert {"balances the robot" in unused.get(joint.name, "") for joint in facts.leg_joints} == {
        not used
    }


def test_file_without_gains(bundled):
    facts = bundled("quadruped.urdf")
    assert declared_gains(facts).gains == {}
    assert standing_gains(facts) == suggest_gains(facts)
