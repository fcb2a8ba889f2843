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
from tests.tables import read_table

DIFFERENCES = read_table(__file__, "differences")
"""What is replaced in the file, the names and the numbers of the result, and its failures."""


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


@pytest.mark.parametrize("title", DIFFERENCES)
def test_compare_models_finds_the_difference(compared, written, title):
    old, new, names, numbers, failures = DIFFERENCES[title]
    text = mjcf_text(written.model, Extras())
    assert old in text
    result = compared(text.replace(old, new, 1))
    assert {name: getattr(result, name) for name in names} == names
    measured = {name: getattr(result, name) for name in numbers}
    assert measured == pytest.approx(numbers, rel=1e-6, abs=1e-8)
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
    assert (result.failures, result.distance) == ((), pytest.approx(0, abs=1e-8))
