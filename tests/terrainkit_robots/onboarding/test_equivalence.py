import mujoco
import numpy as np
import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.export.canonical import to_canonical
from terrainkit_robots.export.fixed_joint_merge import merge_fixed_joints
from terrainkit_robots.export.mjcf import Extras, Site, mjcf_text
from terrainkit_robots.onboarding.equivalence import agreement, expected
from terrainkit_robots.quiet_mujoco import quiet_mujoco


@pytest.fixture
def source():
    return Facts(load_robot(bundled.find("quadruped")))


@pytest.fixture
def written(source):
    return Facts(to_canonical(source).model)


def compiled(text):
    with quiet_mujoco():
        return {"robot.xml": mujoco.MjModel.from_xml_string(text)}


def test_a_faithful_copy_agrees(source, written):
    (found,) = agreement(expected(source, written), compiled(mjcf_text(written.model, Extras())))
    assert found.file == "robot.xml"
    assert found.distance < 1e-8
    assert abs(found.mass) < 1e-8


def test_a_link_out_of_place_is_named(source, written):
    text = mjcf_text(written.model, Extras())
    assert 'name="RR_foot" pos="0 0 -0.213"' in text
    text = text.replace('name="RR_foot" pos="0 0 -0.213"', 'name="RR_foot" pos="0 0 -0.203"')
    (found,) = agreement(expected(source, written), compiled(text))
    assert found.link == "RR_foot"
    assert found.distance == pytest.approx(0.01)


def test_a_joint_that_turns_the_other_way_is_seen(source, written):
    text = mjcf_text(written.model, Extras())
    before = '<joint name="FL_calf_joint" axis="0 1 0"'
    assert before in text
    text = text.replace(before, before.replace("0 1 0", "0 -1 0"))
    (found,) = agreement(expected(source, written), compiled(text))
    assert found.link == "FL_foot"
    assert found.distance > 0.1


def test_a_lost_mass_is_seen(source, written):
    text = mjcf_text(written.model, Extras())
    text = text.replace('mass="0.154"', 'mass="0.254"', 1)
    (found,) = agreement(expected(source, written), compiled(text))
    assert found.mass == pytest.approx(0.1 / source.total_mass, rel=1e-6)
    assert np.isclose(found.distance, 0, atol=1e-8)


def test_a_link_that_is_turned_is_seen(source, written):
    text = mjcf_text(written.model, Extras())
    before = '<body name="RR_foot" pos="0 0 -0.213">'
    assert before in text
    turned = '<body name="RR_foot" pos="0 0 -0.213" quat="0.9998 0 0.02 0">'
    (found,) = agreement(expected(source, written), compiled(text.replace(before, turned)))
    assert found.turned == "RR_foot"
    assert found.angle == pytest.approx(0.04, rel=1e-3)
    assert found.faults == ("RR_foot is turned by 2.29 degrees",)


def test_a_mass_that_is_elsewhere_is_seen(source, written):
    """The same masses and frames, but a calf's centre of mass 1 cm off."""
    text = mjcf_text(written.model, Extras())
    before = '<inertial pos="0.00548 -0.000975 -0.115"'
    assert before in text
    text = text.replace(before, '<inertial pos="0.00548 -0.000975 -0.125"', 1)
    (found,) = agreement(expected(source, written), compiled(text))
    assert (found.mass, found.distance) == (pytest.approx(0, abs=1e-9), pytest.approx(0, abs=1e-9))
    assert found.joint == "FL_calf_joint"
    assert any("what FL_calf_joint carries is off by" in fault for fault in found.faults)


def test_fused_links_are_found_as_frames(source, written):
    single = merge_fixed_joints(written.model, keep=["FL_foot"])
    sites = tuple(
        Site(name=link, body=body, pose=pose)
        for link, (body, pose) in single.frames.items()
        if link != body
    )
    (found,) = agreement(
        expected(source, written), compiled(mjcf_text(single.model, Extras(frames=sites)))
    )
    assert "RR_foot" in {site.name for site in sites}
    assert found.faults == ()
    assert found.distance < 1e-8
