import numpy as np
import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.export.canonical import to_canonical
from terrainkit_robots.export.sites import foot_sites, imu_changes, imu_site


def facts_of(name):
    return Facts(load_robot(bundled.urdf_path(name)))


def test_site_encloses_ball_foot():
    sites = foot_sites(facts_of("quadruped"))
    assert [site.body for site in sites] == ["FL_foot", "FR_foot", "RL_foot", "RR_foot"]
    for site in sites:
        np.testing.assert_allclose(site.pose, np.eye(4), atol=1e-12)
        assert site.half_size == pytest.approx((0.024, 0.024, 0.024))


def test_site_of_flat_foot():
    for site in foot_sites(facts_of("biped")):
        x, y, z = site.half_size
        assert x > y > z
        assert site.pose[2, 3] < 0


def test_imu_at_link(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(
        """<robot name="r"><link name="trunk"/><link name="imu_link"/>
        <joint name="imu_joint" type="fixed"><parent link="trunk"/><child link="imu_link"/>
        <origin xyz="0.1 0.2 0.3"/></joint></robot>"""
    )
    facts = Facts(load_robot(path))
    site = imu_site(facts)
    assert site.body == "trunk"
    np.testing.assert_allclose(site.pose[:3, 3], [0.1, 0.2, 0.3])
    assert imu_changes(facts) == ()


def test_imu_default_is_base(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text('<robot name="r"><link name="trunk"/></robot>')
    facts = Facts(load_robot(path))
    site = imu_site(facts)
    assert site.body == "trunk"
    np.testing.assert_allclose(site.pose, np.eye(4))
    assert imu_changes(facts) == (
        "placed the IMU at the origin of trunk: no sensor, site or link defines it",
    )
    # An arm that is bolted down has none, and nobody misses it.
    arm = Facts(to_canonical(facts, floating=False).model)
    assert imu_changes(arm) == ()


IMU = """<mujoco><worldbody><body name="trunk"><freejoint/><geom size="0.1"/>
  <body name="head" pos="0 0 1"><body name="imu_link" pos="5 5 5"/>
    <site name="sensed" pos="0.1 0.2 0.3"/></body></body></worldbody>
  <sensor><gyro site="sensed"/></sensor></mujoco>"""


def test_imu_of_file_has_precedence(tmp_path):
    path = tmp_path / "robot.xml"
    path.write_text(IMU)
    facts = Facts(to_canonical(Facts(load_robot(path))).model)
    site = imu_site(facts)
    assert site.body == "trunk"  # of which the head is a part
    np.testing.assert_allclose(site.pose[:3, 3], [0.1, 0.2, 1.3])
    assert imu_changes(facts) == ()


def test_imu_of_other_tree_is_ignored(tmp_path):
    path = tmp_path / "robot.xml"
    crate = '<body name="crate"><freejoint/><geom size="0.1"/><site name="sensed"/></body>'
    text = IMU.replace("</worldbody>", f"{crate}</worldbody>")
    text = text.replace('<site name="sensed" pos="0.1 0.2 0.3"/>', "", 1)
    path.write_text(text.replace('name="imu_link"', 'name="cover"'))
    model = to_canonical(Facts(load_robot(path))).model
    assert model.imu is None
    assert imu_changes(Facts(model))[0].startswith("placed the IMU at the origin of trunk")


def test_imu_of_go2(robot_file):
    facts = Facts(to_canonical(Facts(load_robot(robot_file("go2_mjcf/go2.xml")))).model)
    site = imu_site(facts)
    assert site.body == "base_link"
    np.testing.assert_allclose(site.pose[:3, 3], [-0.02557, 0, 0.04232], atol=1e-12)
