import numpy as np
import pytest

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.simulation.pd_gains import suggest_gains
from terrainkit_robots.simulation.rollout import Trial
from terrainkit_robots.simulation.sim_model import plant

INERTIAL = """<inertial><mass value="1"/>
  <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>"""


def quadruped():
    return Facts(load_robot(bundled.find("quadruped")))


def chain(folder, count, shape=""):
    """Return the plant of so many links on a row of hinges, each at the same place."""
    links = [f'<link name="l{k}">{INERTIAL}{shape}</link>' for k in range(count + 1)]
    joints = [
        f'<joint name="j{k}" type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/>'
        '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
        for k in range(count)
    ]
    path = folder / "robot.urdf"
    path.write_text(f'<robot name="r">{"".join(links + joints)}</robot>')
    return plant(Facts(load_robot(path)))


def test_a_robot_is_put_above_the_floor():
    scene = plant(quadruped())
    with quiet_mujoco():
        trial = Trial(scene)
        trial.put(scene.home, above=0.1)
        assert trial.data.qpos[2] == pytest.approx(scene.home[2] + 0.1, abs=1e-6)
        assert trial.data.ncon == 0
        np.testing.assert_array_equal(trial.data.qpos[3:], scene.home[3:])


def test_motors_get_their_gains():
    facts = quadruped()
    scene, gains = plant(facts), suggest_gains(facts)
    with quiet_mujoco():
        trial = Trial(scene, gains)
        trial.put(scene.home, above=1.0)
        trial.data.ctrl[:] = scene.home[7:]
        trial.data.qpos[7] += 0.01
        trial.data.qvel[6] = 0.1
        for _ in trial.steps(0.005):
            break
    gain = gains[scene.drives[0]]
    force = -0.01 * gain.stiffness - 0.1 * gain.damping
    assert trial.data.actuator_force[0] == pytest.approx(force, rel=1e-6)
    dof = scene.model.joint("FL_calf_joint").dofadr[0]
    assert trial.model.dof_armature[dof] == gains["FL_calf_joint"].armature


def test_a_robot_may_be_told_not_to_touch_itself():
    scene = plant(quadruped())
    crossed = scene.home.copy()
    crossed[[7, 10]] = -1.0, 1.0  # both front legs inward
    with quiet_mujoco():
        for self_collision in (True, False):
            trial = Trial(scene, self_collision=self_collision)
            trial.put(crossed, above=1.0)
            assert (trial.data.ncon > 0) == self_collision
            trial.put(scene.home, above=-0.001)
            assert trial.data.ncon == 4  # the feet on the floor


def test_locked_joints_do_not_move():
    scene = plant(quadruped())
    with quiet_mujoco():
        trial = Trial(scene)
        trial.lock()
        trial.put(scene.home, above=0.0)
        for _ in trial.steps(1.0):
            pass
    np.testing.assert_allclose(trial.data.qpos[7:], scene.home[7:], atol=1e-6)


def test_what_is_not_a_number_is_noticed():
    scene = plant(quadruped())
    with quiet_mujoco():
        trial = Trial(scene)
        trial.put(scene.home, above=0.0)
        assert len(list(trial.steps(0.1))) == 20
        assert not trial.blew_up
        trial.data.qvel[0] = np.nan
        assert list(trial.steps(0.1)) == []
        assert trial.blew_up


def test_a_robot_of_too_many_joints_is_not_simulated(tmp_path):
    with pytest.raises(CannotCheckError, match="101 degrees of freedom"):
        Trial(chain(tmp_path, 101))


def test_a_heap_of_shapes_is_not_simulated(tmp_path):
    ball = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
    scene = chain(tmp_path, 40, ball)
    with quiet_mujoco(), pytest.raises(CannotCheckError, match="contacts at once"):
        Trial(scene).put(scene.home)
