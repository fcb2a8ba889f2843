import numpy as np
import pytest

from terrainkit_robots import bundled
from terrainkit_robots.facts import Facts
from terrainkit_robots.robot_file import read_robot
from terrainkit_robots.writing.sites import foot_sites, imu_site


def facts_of(name):
    return Facts(read_robot(bundled.find(name)))


def test_a_ball_foot_is_within_its_site():
    sites = foot_sites(facts_of("quadruped"))
    assert [site.body for site in sites] == ["FL_foot", "FR_foot", "RL_foot", "RR_foot"]
    for site in sites:
        np.testing.assert_allclose(site.pose, np.eye(4), atol=1e-12)
        assert site.half_size == pytest.approx((0.024, 0.024, 0.024))


def test_a_flat_foot_has_a_flat_site_below_the_ankle():
    for site in foot_sites(facts_of("biped")):
        x, y, z = site.half_size
        assert x > y > z
        assert site.pose[2, 3] < 0


def test_the_imu_is_where_its_link_is(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(
        """<robot name="r"><link name="trunk"/><link name="imu_link"/>
        <joint name="imu_joint" type="fixed"><parent link="trunk"/><child link="imu_link"/>
        <origin xyz="0.1 0.2 0.3"/></joint></robot>"""
    )
    site = imu_site(Facts(read_robot(path)))
    assert site.body == "trunk"
    np.testing.assert_allclose(site.pose[:3, 3], [0.1, 0.2, 0.3])


def test_a_robot_without_an_imu_has_it_at_its_base(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text('<robot name="r"><link name="trunk"/></robot>')
    site = imu_site(Facts(read_robot(path)))
    assert site.body == "trunk"
    np.testing.assert_allclose(site.pose, np.eye(4))
