import math

import pytest

from terrainkit_robots.lint.rule import get_rule
from terrainkit_robots.lint.runner import lint
from tests.small_robots import ball, box, facts, joint, link


@pytest.mark.parametrize(
    ("kind", "limits", "share"),
    [("revolute", (-1.8, 0.2), math.acos(0.15 / 0.18)), ("continuous", (), None)],
)
def test_overlap_of_a_joint_without_limits_is_counted_within_1_5_rad(kind, limits, share):
    """The ball turns at 0.3 m, and is in the box while 0.3 - 0.18 cos(q + 0.8) < 0.1 + 0.05."""
    center = f"{-0.18 * math.cos(0.8)} 0 {0.18 * math.sin(0.8)}"
    parts = [link("a", box("0.2 0.2 0.2")), link("b"), link("c", ball(0.05, center))]
    parts.append(joint("a", "b", limits=(-1e-3, 1e-3)))
    parts.append(joint("b", "c", "0.3 0 0", kind=kind, limits=limits))
    found = lint(facts(*parts), [get_rule("COL006")]).findings
    expected = [] if share is None else [pytest.approx(share, abs=0.03)]
    assert [each.measured["share"] for each in found] == expected
