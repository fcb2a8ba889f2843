import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.norms import LEVELS, QUANTITIES, ROLES, Norm, measure, norms
from terrainkit_robots.description.load import load_robot
from tests.robots import QUADRUPED


def test_limits_are_twice_as_far_as_90_percent_of_the_robots():
    norm = Norm(robots=200, values=(1, 1.5, 1.8, 2, 3, 4, 5, 8, 9, 10, 20))
    assert norm.median == 4
    assert norm.usual == (2, 8)
    assert norm.limits == (1, 16)


@pytest.mark.parametrize(
    ("value", "below"), [(0.5, 0), (2, 10), (4, 100), (8, 190), (10, 198), (30, 200)]
)
def test_robots_below_a_value_are_counted(value, below):
    norm = Norm(robots=200, values=(1, 1.5, 1.8, 2, 3, 4, 5, 8, 9, 10, 20))
    assert norm.robots_below(value) == below


def test_norms_rise_from_level_to_level():
    assert norms()
    for (quantity, role), norm in norms().items():
        assert quantity in QUANTITIES
        assert role in ROLES
        assert norm.robots >= 30
        assert len(norm.values) == len(LEVELS)
        assert sorted(norm.values) == list(norm.values)


def test_quadruped_is_measured_by_role():
    found = {
        (s.quantity, s.role, s.element.name): s.value for s in measure(Facts(load_robot(QUADRUPED)))
    }
    # Four thighs of 15.017 kg; a torque of 23.7 N m over 15.017 kg x 9.81 m/s2 x 0.448 m.
    assert found["mass share", "thigh", "FL_thigh"] == pytest.approx(4 * 1.152 / 15.017, rel=1e-3)
    assert found["effort", "hip", "FL_hip_joint"] == pytest.approx(0.359, rel=2e-3)
    assert found["range", "shank", "FL_calf_joint"] == pytest.approx(2.7227 - 0.83776)
    assert found["velocity", "thigh", "FL_thigh_joint"] == 30.1
