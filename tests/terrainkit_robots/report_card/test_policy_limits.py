import dataclasses
import math

import numpy as np
import pytest

from tests.limits import LIMITS as SHARED_LIMITS
from tests.tables import read_table

pytest.importorskip("torch", reason="the extra `train` is not installed")

from terrainkit_robots.policy.evaluate import EvaluationConfig
from terrainkit_robots.report_card import policy_limits as limits_module
from terrainkit_robots.report_card.crossing import CROSSED, FELL, Attempts
from terrainkit_robots.report_card.policy_limits import (
    LEVELS,
    limit_rows,
    limit_tests,
    limits_config,
    measure_limits,
)
from terrainkit_robots.rl.run import open_run

LIMITS = dataclasses.replace(SHARED_LIMITS, slope=0.577, crouched_height=0.35)


@pytest.fixture
def measure(monkeypatch):
    """Return a function that measures a policy that crosses the levels up to a highest one.

    One of two robots crosses the level after it.
    """

    def run(highest, limits=LIMITS):
        class Known:
            def __init__(self, _, terrain_map, num_envs, __):
                assert terrain_map.difficulty.shape == (1, len(highest))
                self.num_envs, parameters = num_envs, terrain_map.parameters[0].tolist()
                self.levels = []
                for each, test in zip(parameters, limit_tests(limits), strict=True):
                    (easy, hard), value = test.values, each.requested[test.parameter]
                    self.levels.append(round((value - easy) / (hard - easy) * (LEVELS - 1)))
                assert 0 <= min(self.levels) <= max(self.levels) < LEVELS

            def attempt(self, levels, columns):
                assert len(levels) == len(columns) == self.num_envs
                above = np.array(self.levels)[columns] - np.array(highest)[columns]
                ok = above <= np.arange(len(columns)) % 2
                outcomes = np.where(ok, CROSSED, FELL).astype(np.int8)
                return Attempts(outcomes=outcomes, seconds=np.zeros(len(levels)))

        monkeypatch.setattr(limits_module, "Crossing", Known)
        return measure_limits(open_run("quadruped"), limits, 2, EvaluationConfig(seed=3))

    return run


def test_bisection_finds_the_hardest_level_of_each_test(measure):
    values = 0.02 + 0.38 * np.arange(LEVELS) / (LEVELS - 1)  # 0.1 to 2 times 0.2 m
    for highest in ([-1, 0, 1, 2, 9, 10, 17, 18, 19], [19, 18, 17, 10, 9, 2, 1, 0, -1]):
        results = measure(highest)["limits"]
        for result, level in zip(results, highest, strict=True):
            assert (result.passed is None) == (level < 0)
            assert (result.failed is None) == (level == LEVELS - 1)
            assert result.crossed == (None if result.failed is None else 1)
        step_up, _, stairs = results[:3]
        assert step_up.failed == (pytest.approx(values[0]) if highest[0] < 0 else None)
        assert stairs.passed == pytest.approx(values[highest[2]], abs=1e-6)
        assert stairs.failed == pytest.approx(values[highest[2] + 1], abs=1e-6)


def test_limits_of_a_robot_with_long_legs(measure):
    """The gap of 1.3 m ends at the sides of the patch, but not along x."""
    results = measure([19] * 9, dataclasses.replace(LIMITS, gap=0.65))["limits"]
    assert results[3].passed == pytest.approx(1.3)


def test_limits_are_printed_with_units(measure):
    results = measure([9, 9, 9, 9, 9, 9, -1, 19, 9])
    rows = limit_rows(results)
    assert rows[:2] == [
        ("test", "2 of 2 cross", "next value", "limit of the robot"),
        ("step up", "20.0 cm", "1 of 2 at 22.0 cm", "20.0 cm"),
    ]
    assert ("clearance", "none", "1 of 2 at 72.0 cm", "35.0 cm") in rows
    assert {row[0]: row[2:] for row in rows}["stone"][0] == "-"
    document = results.document()
    about = [document[key] for key in ("robot", "checkpoint", "repetitions", "seed")]
    assert about == ["quadruped", open_run("quadruped").checkpoint.name, 2, 3]
    assert document["limits"][0]["passed"] == pytest.approx(0.2)


def test_slopes_across_are_as_steep_as_slopes_up(measure):
    results = {each.test: each.passed for each in measure([19] * 9)["limits"]}
    steepest = pytest.approx(math.degrees(math.atan(2 * 0.577)))
    assert (results["slope across"], results["slope up and down"]) == (steepest, steepest)


def test_values_of_the_tests_follow_the_limits_of_the_robot():
    tests = {each.name: each for each in limit_tests(LIMITS)}
    expected = read_table(__file__, "values_of_the_tests_follow_the_limits_of_the_robot")
    assert {name: each.values for name, each in tests.items()} == {
        name: pytest.approx(values) for name, values in expected.items()
    }
    assert tests["stone"].fixed["gap"] == pytest.approx(0.2)
    assert [name for name, each in tests.items() if each.unit == "degrees"] == [
        "slope up and down",
        "slope across",
    ]


def test_values_of_small_and_wide_robots_are_bounded():
    odd = dataclasses.replace(LIMITS, body_width=0.6, foothold=0.01, crouched_height=0.07)
    tests = {each.name: each.values for each in limit_tests(odd)}
    assert tests["corridor"] == pytest.approx((1.5, 0.3))
    assert tests["stone"] == pytest.approx((0.1, 0.005))
    assert tests["clearance"][1] == pytest.approx(0.02)


def test_map_of_limits_has_a_patch_for_each_test():
    levels = [0, 19, 1, 2, 3, 4, 5, 6, 7]
    config = limits_config(limit_tests(LIMITS), levels, 5)
    assert (config.rows, config.cols, config.seed) == (1, 9, 5)
    assert (config.patch_size, config.cell) == ((8.0, 4.0), 0.05)
    parameters = [each.parameters for each in config.terrains]
    assert parameters[0]["depth"] == pytest.approx(0.02)
    assert parameters[1] == {"platform": 2.0, "step_width": 1.0, "step_height": pytest.approx(0.5)}
    assert parameters[2]["step_height"] == pytest.approx(0.04)  # level 1 of 19: 0.02 + 0.38 / 19
    assert parameters[3] == {"platform": 2.0, "width": pytest.approx(0.12)}  # 0.04 + 2 * 0.04
