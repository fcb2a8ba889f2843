import mujoco
import numpy as np
import pytest

from terrainkit_robots.transforms import quat_to_matrix
from tests.terrainkit_robots.description.made_robots import body, mjcf, read


def imu_robot(sensors, *, base="", arm="", world=""):
    """Return a robot with sites in its base, its arm and the world."""
    inside = f"""{world}<body name="base"><geom size="1"/>
      <body name="arm"><joint/><geom size="1"/>{arm}</body>{base}</body>"""
    return read(mjcf(inside, f"<sensor>{sensors}</sensor>"))


def test_imu_is_site_of_gyro():
    robot = imu_robot(
        '<gyro site="here"/>',
        base='<site name="imu"/>',
        arm='<site name="here" pos="1 2 3" euler="0 0 90"/>',
    )
    assert robot.problems == ()
    name, place = robot.imu
    assert name == "arm"
    wanted = [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]
    np.testing.assert_allclose(place, wanted, atol=1e-12)


@pytest.mark.parametrize("sensor", ["gyro", "accelerometer"])
def test_imu_closest_to_base_is_used(sensor):
    sensors = f'<{sensor} site="far"/><{sensor} site="near"/>'
    robot = imu_robot(sensors, arm='<site name="far"/>', base='<site name="near"/>')
    assert robot.imu[0] == "base"


def test_imu_site_by_name():
    other = '<site name="other"/>'
    orientation = '<framequat objtype="site" objname="other"/>'
    assert imu_robot(orientation, base=other, arm='<site name="IMU"/>').imu[0] == "arm"
    assert imu_robot("", base=other, arm='<site name="imu"/>').imu[0] == "arm"


@pytest.mark.parametrize("sites", [{}, {"world": '<site name="imu"/>'}, {"arm": "<site/>"}])
def test_no_imu(sites):
    assert imu_robot('<gyro site="nowhere"/>', **sites).imu is None
    assert imu_robot("", **sites).imu is None


@pytest.mark.parametrize(
    "written", ['pos="0 0 1" euler="30 0 0"', 'type="capsule" size="1" fromto="0 0 1 1 0 2"']
)
def test_site_poses_match_mujoco(written):
    frame = f'<frame pos="1 0 0" euler="0 90 0"><site name="imu" {written}/></frame>'
    text = body(f'<geom size="1"/>{frame}')
    place, model = read(text).imu[1], mujoco.MjModel.from_xml_string(text)
    np.testing.assert_allclose(place[:3, 3], model.site_pos[0], atol=1e-12)
    np.testing.assert_allclose(place[:3, :3], quat_to_matrix(model.site_quat[0]), atol=1e-12)
