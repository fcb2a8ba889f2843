import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terrainkit_robots.analysis.bodies.permutation import is_reordered, permutation
from tests.small_robots import facts

NAMES = st.permutations([f"j{k}" for k in range(12)])


@given(NAMES, NAMES)
def test_permutation_maps_ours_to_theirs(ours, theirs):
    places = permutation(ours, theirs)
    assert list(np.array(ours)[places]) == list(theirs)
    assert permutation(theirs, ours) == list(np.argsort(places))
    assert is_reordered(places) == (ours != theirs)


@pytest.mark.parametrize(
    ("ours", "theirs"), [("ab", "ac"), ("a", "ab"), ("aa", "ab"), ("ab", "aa"), ("aab", "ab")]
)
def test_permutation_of_different_names_is_none(ours, theirs):
    assert permutation(ours, theirs) is None
    assert permutation("", "") == []


def test_joints_are_depth_first(bundled):
    legs = ("FL", "FR", "RL", "RR")
    expected = tuple(f"{leg}_{part}_joint" for leg in legs for part in ("hip", "thigh", "calf"))
    robot = bundled("quadruped.urdf")
    assert tuple(joint.name for joint in robot.joints) == expected
    assert robot.actuator_order == ()
    assert bundled("quadruped.xml").actuator_order == expected


def test_actuator_order_counts_first_actuator_of_each_joint():
    robot = facts(
        '<mujoco><worldbody><body name="a"><geom size="0.1"/><site name="s"/>'
        '<body name="b"><joint name="one" axis="1 0 0"/><geom size="0.1"/></body>'
        '<body name="c"><joint name="two" axis="1 0 0"/><geom size="0.1"/></body>'
        '</body></worldbody><actuator><motor joint="two"/><motor site="s"/><motor joint="one"/>'
        '<motor joint="two"/></actuator></mujoco>'
    )
    assert robot.actuator_order == ("two", "one")
