import numpy as np
import pytest

from terrainkit_robots.analysis.symmetry.mirror_pairs import outlier_first
from tests.small_robots import facts, joint, link

ROUND = ".01 .01 .04 0 0 0"


def arms(left="left", right="right", center="0 -0.1 0", mass=1, more=""):
    """Return the only pair of arms, of which the left one has its center of mass at y = 0.1."""
    parts = [link("trunk"), link(left, center="0 0.1 0", inertia=ROUND)]
    parts += [link(right, center=center, mass=mass, inertia=ROUND), more]
    joints = [joint("trunk", left, "0.1 0.2 0"), joint("trunk", right, "0.1 -0.2 0")]
    robot = facts(*parts, *joints)
    return robot, *robot.mirror_pairs


def test_sides_of_a_pair():
    _, pair = arms()
    assert pair.indices == {1, 2}
    assert pair.sign == 1
    for side, y in ((pair.left, 1), (pair.right, -1)):
        places = [side.point, side.axis, side.offset, side.arm]
        expected = [[0.1, 0.2 * y, 0], [0, 1, 0], [0.1, 0.2 * y, 0], [0, 0.1 * y, 0]]
        np.testing.assert_allclose(places, expected, atol=1e-12)


@pytest.mark.parametrize(
    ("left", "right", "count"), [("left", "right", 1), ("l_a", "r_b", 0), ("x", "y", 0)]
)
def test_pairs_outside_of_legs_have_mirrored_names(left, right, count):
    assert len(arms(left, right)[1:]) == count


def test_center_of_mass_is_compared_with_its_mirror_image():
    # The radius of gyration is 0.2 m of the left arm, and 0.1 m of the heavier right one.
    robot, pair = arms(center="0.003 -0.104 0", mass=4)
    assert pair.com_error(robot.mirror) == pytest.approx(0.005)
    assert pair.max_com_error == pytest.approx(0.002 + 0.1 * 0.1)


@pytest.mark.parametrize(("mass", "is_valid"), [(1, True), (0, False), (-1, False), ("x", False)])
def test_masses_of_a_pair_are_positive(mass, is_valid):
    assert arms(mass=mass)[1].has_valid_masses == is_valid


@pytest.mark.parametrize(("mass", "merged"), [(1, True), (0, False), (None, False)])
def test_body_of_two_links_with_mass_is_merged(mass, merged):
    part = link("part", mass=mass) + joint("left", "part", kind="fixed")
    assert arms(more=part)[1].is_merged == merged


# Of the left, right, rear left and rear right thigh. The other legs decide from a factor of 3 on.
@pytest.mark.parametrize(
    ("values", "first", "decided"),
    [
        ((2, 1, 1, 1), "FL", True),
        ((1, 2, 1, 1), "FR", True),
        ((1, 1, 1, 1), "FR", False),
        ((-1, 1, 1, 1), "FL", True),  # a sign costs 0.01 times the difference
        ((-1, 1.019, 1, 1), "FL", False),
        ((-1, 1.021, 1, 1), "FR", False),
        ((2, 1.3, 1, 1), "FL", True),
        ((2, 1.4, 1, 1), "FL", False),
        ((None, 2, 1, 1), "FL", True),
        ((1, None, 1, 1), "FR", True),
        ((1, 2, None, 2), "FR", False),
        ((2, 1, 1, None), "FL", True),
    ],
)
def test_outlier_differs_from_the_other_leg_of_its_side(bundled, values, first, decided):
    robot = bundled("quadruped.urdf")
    table = dict(zip(("FL_thigh", "FR_thigh", "RL_thigh", "RR_thigh"), values, strict=True))
    pair = next(p for p in robot.mirror_pairs if p.left.body.name == "FL_thigh")

    def value(body):
        return None if table[body.name] is None else np.array([table[body.name]])

    odd, other, reason = outlier_first(robot, pair, value)
    others = "FR_thigh" if first == "FL" else "FL_thigh"
    assert (odd.body.name, other.body.name) == (f"{first}_thigh", others)
    assert ("either side" in reason, odd.body.name in reason) == (not decided, decided)


@pytest.mark.parametrize(
    ("misfits", "first", "reason"),
    [
        ((3.1, 1), "left", "the shapes of left_knee_link contradict it"),
        ((2.9, 1), "right", "either side may be wrong"),
        ((0, 0.1), "right", "the shapes of right_knee_link contradict it"),
        ((None, 1), "right", "either side may be wrong"),
    ],
)
def test_shapes_decide_without_other_legs(bundled, misfits, first, reason):
    robot = bundled("biped.urdf")
    names = "left_knee_link", "right_knee_link"
    pair = next(p for p in robot.mirror_pairs if p.left.body.name == names[0])
    table = dict(zip(names, misfits, strict=True))
    found = outlier_first(robot, pair, lambda body: body.inertia, lambda body: table[body.name])
    assert (found.odd.body.name, found.reason) == (f"{first}_knee_link", reason)
