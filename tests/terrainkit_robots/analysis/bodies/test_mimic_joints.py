from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terrainkit_robots.analysis.bodies.mimic_joints import mimic_joints, mimic_positions
from terrainkit_robots.description.model import Joint, Mimic, Source
from tests.small_robots import URDF

SOURCE = Source(file=URDF, line=1)
NAMES = "ABCDEFGH"


def chain(*mimics):
    """Return joints A, B, ... each of which mimics a joint (name, multiplier, offset) or none."""
    made = []
    for name, mimic in zip(NAMES, mimics, strict=False):
        fields = mimic and dict(zip(("joint", "multiplier", "offset"), mimic, strict=True))
        follows = mimic and Mimic(source=SOURCE, **fields)
        joint = Joint(name=name, source=SOURCE, kind="prismatic", parent="", child="")
        made.append(replace(joint, mimic=follows))
    return made


def order(joints):
    return "".join(joint.name for joint in mimic_joints(joints))


CASES = {
    "chain": ([None, ("A", 1, 0.5), ("B", -2, 0)], {"A": 1.0}, {"B": 1.5, "C": -3.0}),
    "backwards": ([("B", -2, 0), ("C", 1, 0.5), None], {"C": 1.0}, {"B": 1.5, "A": -3.0}),
    "at zero": ([None, ("A", 2, 1)], {}, {"B": 1.0}),
    "unknown": ([None, None, ("unknown", 2, 1)], {"C": 7.0}, {}),
    "below": ([None, ("unknown", 2, 1), ("B", 2, 1)], {"B": 7.0}, {"C": 15.0}),
    "itself": ([None, None, ("C", 2, 1)], {"C": 7.0}, {}),
    "cycle": ([("B", 1, 0), ("C", 1, 0), ("A", 2, 1)], {"C": 7.0}, {}),
    "tail": ([("B", 1, 0), ("A", 1, 0), ("B", 2, 0)], {"A": 5.0, "B": 3.0}, {"C": 6.0}),
}


@pytest.mark.parametrize(("mimics", "positions", "expected"), CASES.values(), ids=CASES)
def test_mimic_positions(mimics, positions, expected):
    joints = chain(*mimics)
    assert order(joints) == "".join(expected)
    assert mimic_positions(joints, positions) == expected


def test_mimic_positions_broadcast():
    drawn = np.linspace(-1, 1, 5)
    found = mimic_positions(chain(("B", -2, 0), ("C", 1, 0.5), None), {"C": drawn, "A": drawn})
    np.testing.assert_allclose(found["A"], -2 * (drawn + 0.5))


def test_mimic_positions_stay_finite():
    joints = chain(None, *((name, -9e29, 9e29) for name in NAMES[:7]))
    for position in (1.0, np.array([1.0, -1e30])):
        for found in mimic_positions(joints, {"A": position}).values():
            assert (np.abs(found) <= 1e30).all()


@given(st.lists(st.integers(-1, 7), min_size=8, max_size=8), st.permutations(range(8)))
def test_mimic_joints_come_after_their_targets(leaders, shuffled):
    joints = chain(*(None if k < 0 else (NAMES[k], 2, 0.1) for k in leaders))
    found = order([joints[k] for k in shuffled])
    assert len(set(found)) == len(found)
    for name in found:
        target = NAMES[leaders[NAMES.index(name)]]
        assert found.find(target) < found.index(name)
    # Excluded joints lead back to themselves.
    for k, leader in enumerate(leaders):
        if leader >= 0 and NAMES[k] not in found:
            path = [leader]
            while path[-1] != k:
                path.append(leaders[path[-1]])
                assert path[-1] >= 0
                assert len(path) <= 8
