import pytest

from tests.small_robots import ball, facts, joint, link


def arm(side, y, mass=2, center=0.1, ixx=0.01, length=0.3, upper=1, radius=0.05, axis="0 1 0"):
    """Return an arm of two links that is mounted at `y`."""
    part = {"mass": mass, "center": f"0 {center} 0", "inertia": f"{ixx} 0.02 0.02 0 0 0"}
    limits = (-1, upper)
    return (
        link(f"{side}_0", ball(radius), **part)
        + joint("trunk", f"{side}_0", f"0 {y} 0", limits=limits)
        + link(f"{side}_1", ball(radius), **part)
        + joint(f"{side}_0", f"{side}_1", f"{length} 0 0.1", axis, limits=limits)
    )


def copies(**changed):
    robot = facts(link("trunk"), arm("left", 0.2), arm("right", -0.2, **changed))
    return [pair.left.body.name for pair in robot.copied_pairs]


def test_equal_arms_are_copies_wherever_they_are_mounted():
    assert copies() == ["left_0", "left_1"]


@pytest.mark.parametrize(
    ("name", "rounded", "other"),
    [
        ("mass", 2.0019, 2.01),
        ("center", 0.10009, 0.1002),
        ("ixx", 0.010019, 0.01003),  # 0.001 of the largest moment
        ("length", 0.30009, 0.3002),
    ],
)
def test_arms_that_differ_by_more_than_rounding_are_no_copies(name, rounded, other):
    assert copies(**{name: rounded}) == ["left_0", "left_1"]
    assert copies(**{name: other}) == []


@pytest.mark.parametrize(("name", "value"), [("upper", 1.1), ("radius", 0.06), ("axis", "0 0 1")])
def test_arms_with_other_limits_or_shapes_are_no_copies(name, value):
    assert copies(**{name: value}) == []


def test_one_equal_body_is_no_copy():
    arms = [link(n) + joint("trunk", n, f"0 {y} 0") for n, y in (("left", 0.2), ("right", -0.2))]
    assert facts(link("trunk"), *arms).copied_pairs == ()
