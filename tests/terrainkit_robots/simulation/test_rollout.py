import numpy as np
import pytest

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.simulation.pd_gains import suggest_gains
from terrainkit_robots.simulation.rollout import Rollout
from terrainkit_robots.simulation.sim_model import make_sim_model
from tests import small_robots
from tests.small_robots import ball, joint, link


@pytest.fixture
def facts(bundled):
    return bundled("quadruped.urdf")


@pytest.fixture
def sim(facts):
    return make_sim_model(facts)


def chain(count, *shapes):
    """Return the facts of a chain of hinges, all at the same point."""
    links = [link(f"l{k}", *shapes) for k in range(count + 1)]
    joints = [joint(f"l{k}", f"l{k + 1}", limits=(-1, 1)) for k in range(count)]
    return small_robots.facts(*links, *joints)


def test_reset_places_robot_above_floor(sim):
    with quiet_mujoco():
        rollout = Rollout(sim)
        rollout.reset(sim.standing_qpos, clearance=0.1)
        assert rollout.data.qpos[2] == pytest.approx(sim.standing_qpos[2] + 0.1, abs=1e-6)
        assert rollout.data.ncon == 0
        np.testing.assert_array_equal(rollout.data.qpos[3:], sim.standing_qpos[3:])


def test_rollout_applies_gains(facts, sim):
    gains = suggest_gains(facts)
    with quiet_mujoco():
        rollout = Rollout(sim, gains)
        rollout.reset(sim.standing_qpos, clearance=1.0)
        rollout.data.ctrl[:] = sim.standing_qpos[7:]
        rollout.data.qpos[7] += 0.01
        rollout.data.qvel[6] = 0.1
        for _ in rollout.steps(0.005):
            break
    gain = gains[sim.actuated[0]]
    force = -0.01 * gain.stiffness - 0.1 * gain.damping
    assert rollout.data.actuator_force[0] == pytest.approx(force, rel=1e-6)
    dof = sim.model.joint("FL_calf_joint").dofadr[0]
    assert rollout.model.dof_armature[dof] == gains["FL_calf_joint"].armature


def test_rollout_without_self_collision(sim):
    crossed = sim.standing_qpos.copy()
    crossed[[7, 10]] = -1.0, 1.0  # both front legs inward
    with quiet_mujoco():
        for self_collision in (True, False):
            rollout = Rollout(sim, self_collision=self_collision)
            rollout.reset(crossed, clearance=1.0)
            assert (rollout.data.ncon > 0) == self_collision
            rollout.reset(sim.standing_qpos, clearance=-0.001)
            assert rollout.data.ncon == 4  # the feet on the floor


def test_rollout_detects_divergence(sim):
    with quiet_mujoco():
        rollout = Rollout(sim)
        rollout.reset(sim.standing_qpos, clearance=0.0)
        assert len(list(rollout.steps(0.1))) == 20
        assert not rollout.diverged
        rollout.data.qvel[0] = np.nan
        assert list(rollout.steps(0.1)) == []
        assert rollout.diverged


def test_rollout_rejects_many_joints():
    Rollout(make_sim_model(chain(100)))
    with pytest.raises(CannotCheckError, match="degrees of freedom: got 101"):
        Rollout(make_sim_model(chain(101)))


def test_rollout_rejects_many_contacts():
    sim = make_sim_model(chain(40, ball(0.1)))
    with quiet_mujoco(), pytest.raises(CannotCheckError, match="contacts: got"):
        Rollout(sim).reset(sim.standing_qpos)


def test_inertia_of_the_contact_solver_includes_the_armature_of_the_gains(facts, sim):
    gains = suggest_gains(facts)
    with quiet_mujoco():
        added = Rollout(sim, gains).model.dof_M0 - Rollout(sim).model.dof_M0
    for name in sim.actuated:
        dof = sim.model.joint(name).dofadr[0]
        declared = sim.model.dof_armature[dof]
        assert added[dof] == pytest.approx(gains[name].armature - declared)


@pytest.mark.parametrize("self_collision", [False, True])
def test_disabled_floor_has_no_contacts(sim, self_collision):
    with quiet_mujoco():
        rollout = Rollout(sim, self_collision=self_collision)
        rollout.reset(sim.standing_qpos, clearance=-0.01)
        assert 0 in rollout.model.geom_bodyid[rollout.data.contact.geom]
        rollout.disable_floor()
        rollout.reset(sim.standing_qpos, clearance=-0.01)
        assert 0 not in rollout.model.geom_bodyid[rollout.data.contact.geom]
