import mujoco
import numpy as np
import pytest

from terrainkit_robots.analysis.simulator_conventions.armature import inertia_without_armature
from terrainkit_robots.description import bundled
from tests.small_robots import facts, mjcf


def test_inertias_of_point_mass_on_rod():
    # 2 kg at 0.5 m from the axis of j1: 0.5 kg m2 plus its own 0.001; about j2 only 0.001.
    inertial = '<inertial pos="0 0 0" mass="2" diaginertia="0.001 0.001 0.001"/>'
    robot = mjcf(
        '<body name="b"><freejoint/><geom size="0.1"/>'
        '<body name="arm"><joint name="j1" axis="0 0 1"/>'
        '<inertial pos="0 0 0" mass="1e-9" diaginertia="1e-9 1e-9 1e-9"/>'
        f'<body name="tip" pos="0.5 0 0"><joint name="j2" axis="0 0 3"/>{inertial}</body>'
        "</body></body>"
    )
    moved = inertia_without_armature(robot)
    by_name = {joint.name: inertia for joint, inertia in moved.items()}
    assert by_name == pytest.approx({"j1": 0.501, "j2": 0.001}, rel=1e-6)


def test_inertias_exclude_joints_with_armature():
    geom = '<geom size="0.1" mass="1"/>'
    robot = mjcf(
        f'<body name="b"><freejoint/>{geom}<body name="a">{geom}<joint name="j" armature="0.01"/>'
        f'</body><body name="s">{geom}<joint name="slide" type="slide"/></body></body>'
    )
    ((joint, inertia),) = inertia_without_armature(robot).items()
    assert (joint.name, inertia) == ("slide", pytest.approx(1.0))


@pytest.mark.parametrize("name", ["quadruped", "biped"])
def test_inertias_match_mass_matrix_of_mujoco(name):
    path = bundled.urdf_path(name)
    # With a fixed base, the diagonal of the mass matrix is the inertia about each axis.
    model = mujoco.MjModel.from_xml_path(str(path))
    data, matrix = mujoco.MjData(model), np.zeros((model.nv, model.nv))
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, matrix)
    robot = facts(path.read_text())
    moved = inertia_without_armature(robot)
    places = [model.joint(joint.name).dofadr[0] for joint in moved]
    assert list(moved.values()) == pytest.approx(np.diag(matrix)[places], rel=1e-6)
