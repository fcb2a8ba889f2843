import pytest

from terrainkit_robots.analysis.unit_errors import body_unit_errors
from tests.small_robots import box, facts, joint, link

EXACT, ROUND = "1.66667e7 1.66667e7 3.33333e6 0 0 0", "2e7 2e7 3e6 0 0 0"
"""Inertia of a box of 2 kg in g mm2, and with one digit."""


@pytest.mark.parametrize(("number", "is_wrong"), [(2, True), (3, False)])
def test_inertias_are_not_judged_if_most_have_one_digit(number, is_wrong):
    shape = box("0.1 0.1 0.3", "0 0 0.15")
    inertias = [ROUND] * number + [EXACT] * (4 - number)
    parts = [link(k, shape, mass=2, inertia=each) for k, each in enumerate(inertias)]
    parts += [joint(k, k + 1, "0 0 0.3") for k in range(3)]
    assert list(dict(body_unit_errors(facts(*parts)))) == ["inertias"] * is_wrong


@pytest.mark.parametrize(("scale", "unit"), [(20, ""), (39.37, "inches"), (1000, "millimeters")])
def test_factor_of_all_lengths_is_named_only_if_it_is_a_unit(scale, unit):
    shape = box(f"{0.1 * scale} {0.1 * scale} {0.3 * scale}", f"0 0 {0.15 * scale}")
    parts = [link(k, shape, mass=2, inertia=EXACT) for k in range(4)]
    parts += [joint(k, k + 1, f"0 0 {0.3 * scale}") for k in range(3)]
    error = dict(body_unit_errors(facts(*parts)))["lengths"]
    assert error.quantity.unit(error.factor)[1] == unit
