import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terrainkit_robots.analysis.bodies.kinematics import body_poses
from terrainkit_robots.analysis.bodies.mimic_joints import mimic_joints, mimic_positions
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot


def chain(tmp_path, *mimics):
    """Return a chain of prismatic joints jA, jB, ... with the given <mimic> elements."""
    names = [f"j{letter}" for letter in "ABCDEFGH"[: len(mimics)]]
    links = "".join(f'<link name="l{k}"/>' for k in range(len(mimics) + 1))
    joints = "".join(
        f'<joint name="{name}" type="prismatic"><parent link="l{k}"/><child link="l{k + 1}"/>'
        f'<limit lower="-9" upper="9" effort="1" velocity="1"/>{mimic}</joint>'
        for k, (name, mimic) in enumerate(zip(names, mimics, strict=True))
    )
    path = tmp_path / "robot.urdf"
    path.write_text(f'<robot name="r">{links}{joints}</robot>')
    return Facts(load_robot(path))


def follows(joint, multiplier=1.0, offset=0.0):
    return f'<mimic joint="{joint}" multiplier="{multiplier}" offset="{offset}"/>'


def test_mimic_positions_of_chained_joints(tmp_path):
    robot = chain(tmp_path, "", follows("jA", offset=0.5), follows("jB", -2))
    assert mimic_positions(robot.joints, {"jA": 1.0}) == {"jB": 1.5, "jC": -3.0}
    # In any order of the file.
    backwards = chain(tmp_path, follows("jB", -2), follows("jC", offset=0.5), "")
    assert [joint.name for joint in mimic_joints(backwards.joints)] == ["jB", "jA"]
    assert mimic_positions(backwards.joints, {"jC": 1.0}) == {"jB": 1.5, "jA": -3.0}
    assert body_poses(robot.bodies, {"jA": 1.0})[3][0, 3] == pytest.approx(1.0 + 1.5 - 3.0)
    assert body_poses(backwards.bodies, {"jC": 1.0})[3][0, 3] == pytest.approx(1.0 + 1.5 - 3.0)


def test_mimic_positions_broadcast(tmp_path):
    robot = chain(tmp_path, follows("jB", -2), follows("jC", offset=0.5), "")
    drawn = np.linspace(-1, 1, 5)
    found = mimic_positions(robot.joints, {"jC": drawn, "jA": drawn})
    np.testing.assert_allclose(found["jA"], -2 * (drawn + 0.5))


@pytest.mark.parametrize(
    "mimics",
    [
        ("", "", follows("unknown", 2, 1)),
        ("", "", follows("jC", 2, 1)),  # itself
        (follows("jB"), follows("jC"), follows("jA", 2, 1)),  # a cycle
        ("", "", follows("", 2, 1)),
    ],
)
def test_mimic_joints_exclude_unknown_targets_and_cycles(tmp_path, mimics):
    robot = chain(tmp_path, *mimics)
    assert mimic_joints(robot.joints) == ()
    assert mimic_positions(robot.joints, {"jC": 7.0}) == {}
    assert body_poses(robot.bodies, {"jC": 7.0})[3][0, 3] == pytest.approx(7.0)


def test_mimic_positions_follow_joint_in_cycle(tmp_path):
    robot = chain(tmp_path, follows("jB"), follows("jA"), follows("jB", 2))
    assert mimic_positions(robot.joints, {"jA": 5.0, "jB": 3.0}) == {"jC": 6.0}


def test_mimic_positions_ignore_fixed_targets(tmp_path):
    robot = chain(tmp_path, "", follows("jA", 2, 1))
    path = tmp_path / "robot.urdf"
    path.write_text(path.read_text().replace('"prismatic"', '"fixed"', 1))
    assert mimic_positions(Facts(load_robot(path)).joints, {"jA": 1.0}) == {}
    assert len(robot.joints) == 2


def test_mimic_positions_stay_finite(tmp_path):
    robot = chain(tmp_path, "", *(follows(f"j{letter}", -9e29, 9e29) for letter in "ABCDEFG"))
    for position in (1.0, np.array([1.0, -1e30])):
        for found in mimic_positions(robot.joints, {"jA": position}).values():
            assert np.isfinite(found).all()


@given(st.lists(st.integers(-1, 7), min_size=8, max_size=8), st.permutations(range(8)))
def test_mimic_joints_come_after_their_targets(tmp_path_factory, leaders, order):
    folder = tmp_path_factory.getbasetemp()
    names = [f"j{letter}" for letter in "ABCDEFGH"]
    mimics = ["" if k < 0 else follows(names[k], 2, 0.1) for k in leaders]
    joints = chain(folder, *mimics).joints
    found = mimic_joints([joints[k] for k in order])
    placed = {joint.name: place for place, joint in enumerate(found)}
    assert len(placed) == len(found)
    for joint in found:
        assert placed.get(joint.mimic.joint, -1) < placed[joint.name]
    # Excluded joints lead back to themselves, or to an unknown joint.
    for k, leader in enumerate(leaders):
        if leader >= 0 and names[k] not in placed:
            path = [leader]
            while path[-1] != k:
                path.append(leaders[path[-1]])
                assert path[-1] >= 0
                assert len(path) <= 8
