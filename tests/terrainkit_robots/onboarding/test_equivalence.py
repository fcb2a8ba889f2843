import math

import mujoco
import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.export.canonical import to_canonical
from terrainkit_robots.export.fixed_joint_merge import merge_fixed_joints
from terrainkit_robots.export.mjcf import Extras, Site, mjcf_text
from terrainkit_robots.onboarding.equivalence import (
    Equivalence,
    compare_models,
    reference_kinematics,
)
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from tests.robots import QUADRUPED

FOOT = 'name="RR_foot" pos="0 0 -0.213"'
EXACT = pytest.approx(0, abs=1e-8)


@pytest.fixture(scope="module")
def source():
    return Facts(load_robot(QUADRUPED))


@pytest.fixture(scope="module")
def written(source):
    return Facts(to_canonical(source).model)


@pytest.fixture
def compared(source, written):
    """Return a function that compares an MJCF with the source."""

    def run(text):
        with quiet_mujoco():
            models = {"robot.xml": mujoco.MjModel.from_xml_string(text)}
        (result,) = compare_models(reference_kinematics(source, written), models)
        assert result.file == "robot.xml"
        return result

    return run


@pytest.mark.parametrize(
    ("old", "new", "expected", "failures"),
    [
        ("", "", {"distance": EXACT, "angle": EXACT, "mass": EXACT, "inertia": EXACT}, []),
        (
            FOOT,
            FOOT.replace("0.213", "0.203"),
            {"link": "RR_foot", "distance": pytest.approx(0.01), "mass": EXACT},
            ["the position of RR_foot is off by 10 mm", "the inertia about RR_"],
        ),
        (
            FOOT,
            f'{FOOT} quat="0.9998 0 0.02 0"',
            {"angle_link": "RR_foot", "angle": pytest.approx(0.04, rel=1e-3), "distance": EXACT},
            ["the orientation of RR_foot is off by 2.29 degrees"],
        ),
        (
            '<joint name="FL_calf_joint" axis="0 1 0"',
            '<joint name="FL_calf_joint" axis="0 -1 0"',
            {"link": "FL_foot", "mass": EXACT},
            ["the position of FL_foot", "the orientation of FL_"],
        ),
        (
            'mass="0.154"',
            'mass="0.254"',
            {"mass": pytest.approx(0.1 / 15.017, rel=1e-6), "distance": EXACT},
            ["the mass is off by 0.67%", "the inertia about FL_thigh_joint"],
        ),
        (  # masses and frames are the same, but a center of mass is off by 1 cm
            '<inertial pos="0.00548 -0.000975 -0.115"',
            '<inertial pos="0.00548 -0.000975 -0.125"',
            {"mass": EXACT, "distance": EXACT, "joint": "FL_calf_joint"},
            ["the inertia about FL_calf_joint is off by"],
        ),
    ],
    ids=["copy", "position", "orientation", "axis", "mass", "center of mass"],
)
def test_compare_models_finds_the_difference(compared, written, old, new, expected, failures):
    text = mjcf_text(written.model, Extras())
    assert old in text
    result = compared(text.replace(old, new, 1))
    assert {name: getattr(result, name) for name in expected} == expected
    assert len(result.failures) == len(failures)
    for found, start in zip(result.failures, failures, strict=True):
        assert found.startswith(start)


@pytest.mark.parametrize(
    ("name", "limit"),
    [("distance", 1e-4), ("angle", 1e-3), ("mass", 1e-3), ("mass", -1e-3), ("inertia", 1e-3)],
)
def test_differences_above_the_limits_are_failures(name, limit):
    exact = dict.fromkeys(("distance", "angle", "mass", "inertia"), 0.0)
    names = {"file": "f", "link": "a", "angle_link": "b", "joint": "c"}
    for factor, number in ((0.99, 0), (1.01, 1)):
        result = Equivalence(**names, **exact | {name: factor * limit})
        assert len(result.failures) == number
    assert math.isclose(getattr(result, name), 1.01 * limit)


def test_compare_models_finds_merged_links_as_sites(compared, written):
    single = merge_fixed_joints(written.model, keep=["FL_foot"])
    sites = tuple(
        Site(name=link, body=body, pose=pose)
        for link, (body, pose) in single.frames.items()
        if link != body
    )
    assert "RR_foot" in {site.name for site in sites}
    result = compared(mjcf_text(single.model, Extras(frames=sites)))
    assert (result.failures, result.distance) == ((), EXACT)
