import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from terrainkit_robots.analysis.bodies.joint_order import is_reordered, permutation
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot

NAMES = st.permutations([f"j{k}" for k in range(12)])


@given(NAMES, NAMES)
def test_permutation_maps_ours_to_theirs(ours, theirs):
    places = permutation(ours, theirs)
    assert list(np.array(ours)[places]) == list(theirs)
    assert list(np.array(theirs)[np.argsort(places)]) == list(ours)
    assert permutation(theirs, ours) == list(np.argsort(places))
    assert is_reordered(places) == (ours != theirs)


def test_permutation_of_different_names_is_none():
    assert permutation(["a", "b"], ["a", "c"]) is None
    assert permutation(["a"], ["a", "b"]) is None
    assert permutation(["a", "a"], ["a", "b"]) is None
    assert permutation(["a", "b"], ["a", "a"]) is None
    assert permutation(["a", "a", "b"], ["a", "b"]) is None
    assert permutation([], []) == []


def test_joints_are_depth_first():
    path = bundled.urdf_path("quadruped")
    robot = Facts(load_robot(path))
    legs = ("FL", "FR", "RL", "RR")
    expected = tuple(f"{leg}_{part}_joint" for leg in legs for part in ("hip", "thigh", "calf"))
    assert tuple(joint.name for joint in robot.joints) == expected
    assert robot.actuator_order == ()
    assert Facts(load_robot(path.with_suffix(".xml"))).actuator_order == expected


def test_actuator_order_counts_first_actuator_of_each_joint(tmp_path):
    path = tmp_path / "robot.xml"
    path.write_text(
        '<mujoco><worldbody><body name="a"><geom size="0.1"/><site name="s"/>'
        '<body name="b"><joint name="one" axis="1 0 0"/><geom size="0.1"/></body>'
        '<body name="c"><joint name="two" axis="1 0 0"/><geom size="0.1"/></body>'
        '</body></worldbody><actuator><motor joint="two"/><motor site="s"/><motor joint="one"/>'
        '<motor joint="two"/></actuator></mujoco>'
    )
    assert Facts(load_robot(path)).actuator_order == ("two", "one")
