from dataclasses import replace

import numpy as np
import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.export.canonical import to_canonical
from terrainkit_robots.export.sites import foot_sites, imu_changes, imu_site


def facts_of(name):
    return Facts(load_robot(bundled.urdf_path(name)))


def test_sites_enclose_feet():
    """A foot is a ball of 22 mm, or a flat sole; the margin is 2 mm."""
    sites = foot_sites(facts_of("quadruped"), ["RR_calf"])
    assert [site.name for site in sites] == ["FL_foot", "FR_foot", "RL_foot", "RR_calf"]
    for site, height in zip(sites, [0, 0, 0, -0.213], strict=True):
        assert site.name == site.body
        np.testing.assert_allclose(site.pose[:3, 3], [0, 0, height], atol=1e-12)
        assert site.half_size == pytest.approx((0.024, 0.024, 0.024))
    for site in foot_sites(facts_of("biped")):
        x, y, z = site.half_size
        assert x > y > z
        assert site.pose[2, 3] < 0


def test_foot_without_shapes_has_a_site_without_size():
    model = facts_of("quadruped").model
    links = [
        replace(each, collisions=()) if each.name in ("FL_calf", "FL_foot") else each
        for each in model.links
    ]
    site = foot_sites(Facts(replace(model, links=tuple(links))))[0]
    assert (site.name, site.pose.tolist(), site.half_size) == ("FL_foot", np.eye(4).tolist(), ())


IMU_LINK = """<link name="{}"/><joint name="imu_joint" type="fixed"><parent link="trunk"/>
  <child link="{}"/><origin xyz="0.1 0.2 0.3"/></joint>"""


@pytest.mark.parametrize(
    ("link", "place", "is_found"), [("My_IMU", (0.1, 0.2, 0.3), True), ("camera", (0, 0, 0), False)]
)
def test_imu_is_at_link_or_origin_of_base(link, place, is_found, robot):
    facts = robot(f'<robot name="r"><link name="trunk"/>{IMU_LINK.format(link, link)}</robot>')
    site = imu_site(facts)
    assert (site.name, site.body, site.pose[:3, 3].tolist()) == ("imu", "trunk", list(place))
    told = "placed the IMU at the origin of trunk: no sensor, site or link defines it"
    assert imu_changes(facts) == (() if is_found else (told,))
    # An arm that is bolted down needs none.
    assert imu_changes(Facts(to_canonical(facts, floating=False).model)) == ()


IMU = """<mujoco><worldbody><body name="trunk"><freejoint/><geom size="0.1"/>
  <body name="head" pos="0 0 1"><body name="{}" pos="5 5 5"/>{}</body></body>{}</worldbody>
  <sensor><gyro site="sensed"/></sensor></mujoco>"""
SITE = '<site name="sensed" pos="0.1 0.2 0.3"/>'


def test_imu_of_file_has_precedence(robot):
    facts = Facts(to_canonical(robot(IMU.format("imu_link", SITE, ""))).model)
    site = imu_site(facts)
    assert site.body == "trunk"  # of which the head is a part
    np.testing.assert_allclose(site.pose[:3, 3], [0.1, 0.2, 1.3])
    assert imu_changes(facts) == ()


def test_imu_of_other_tree_is_ignored(robot):
    crate = f'<body name="crate"><freejoint/><geom size="0.1"/>{SITE}</body>'
    model = to_canonical(robot(IMU.format("cover", "", crate))).model
    assert model.imu is None
    assert imu_changes(Facts(model))[0].startswith("placed the IMU at the origin of trunk")
