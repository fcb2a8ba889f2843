import mujoco
import numpy as np
import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.export.canonical import to_canonical
from terrainkit_robots.export.fixed_joint_merge import merge_fixed_joints
from terrainkit_robots.export.mjcf import Extras, Site, mjcf_text
from terrainkit_robots.onboarding.equivalence import compare_models, reference_kinematics
from terrainkit_robots.quiet_mujoco import quiet_mujoco


@pytest.fixture
def source():
    return Facts(load_robot(bundled.urdf_path("quadruped")))


@pytest.fixture
def written(source):
    return Facts(to_canonical(source).model)


def compiled(text):
    with quiet_mujoco():
        return {"robot.xml": mujoco.MjModel.from_xml_string(text)}


def test_compare_models_accepts_copy(source, written):
    (result,) = compare_models(
        reference_kinematics(source, written), compiled(mjcf_text(written.model, Extras()))
    )
    assert result.file == "robot.xml"
    assert result.distance < 1e-8
    assert abs(result.mass) < 1e-8


def test_compare_models_reports_displaced_link(source, written):
    text = mjcf_text(written.model, Extras())
    assert 'name="RR_foot" pos="0 0 -0.213"' in text
    text = text.replace('name="RR_foot" pos="0 0 -0.213"', 'name="RR_foot" pos="0 0 -0.203"')
    (result,) = compare_models(reference_kinematics(source, written), compiled(text))
    assert result.link == "RR_foot"
    assert result.distance == pytest.approx(0.01)


def test_compare_models_reports_inverted_axis(source, written):
    text = mjcf_text(written.model, Extras())
    before = '<joint name="FL_calf_joint" axis="0 1 0"'
    assert before in text
    text = text.replace(before, before.replace("0 1 0", "0 -1 0"))
    (result,) = compare_models(reference_kinematics(source, written), compiled(text))
    assert result.link == "FL_foot"
    assert result.distance > 0.1


def test_compare_models_reports_wrong_mass(source, written):
    text = mjcf_text(written.model, Extras())
    text = text.replace('mass="0.154"', 'mass="0.254"', 1)
    (result,) = compare_models(reference_kinematics(source, written), compiled(text))
    assert result.mass == pytest.approx(0.1 / source.total_mass, rel=1e-6)
    assert np.isclose(result.distance, 0, atol=1e-8)


def test_compare_models_reports_rotated_link(source, written):
    text = mjcf_text(written.model, Extras())
    before = '<body name="RR_foot" pos="0 0 -0.213">'
    assert before in text
    turned = '<body name="RR_foot" pos="0 0 -0.213" quat="0.9998 0 0.02 0">'
    (result,) = compare_models(
        reference_kinematics(source, written), compiled(text.replace(before, turned))
    )
    assert result.angle_link == "RR_foot"
    assert result.angle == pytest.approx(0.04, rel=1e-3)
    assert result.failures == ("the orientation of RR_foot is off by 2.29 degrees",)


def test_compare_models_reports_displaced_center_of_mass(source, written):
    """Masses and frames are the same, but the center of mass of a calf is off by 1 cm."""
    text = mjcf_text(written.model, Extras())
    before = '<inertial pos="0.00548 -0.000975 -0.115"'
    assert before in text
    text = text.replace(before, '<inertial pos="0.00548 -0.000975 -0.125"', 1)
    (result,) = compare_models(reference_kinematics(source, written), compiled(text))
    assert (result.mass, result.distance) == (
        pytest.approx(0, abs=1e-9),
        pytest.approx(0, abs=1e-9),
    )
    assert result.joint == "FL_calf_joint"
    assert any("the inertia about FL_calf_joint is off by" in text for text in result.failures)


def test_compare_models_finds_merged_links_as_sites(source, written):
    single = merge_fixed_joints(written.model, keep=["FL_foot"])
    sites = tuple(
        Site(name=link, body=body, pose=pose)
        for link, (body, pose) in single.frames.items()
        if link != body
    )
    (result,) = compare_models(
        reference_kinematics(source, written),
        compiled(mjcf_text(single.model, Extras(frames=sites))),
    )
    assert "RR_foot" in {site.name for site in sites}
    assert result.failures == ()
    assert result.distance < 1e-8
