import math

import numpy as np
import pytest

pytest.importorskip("torch", reason="the extra `train` is not installed")

from terrainkit.feasibility import RobotLimits
from terrainkit_robots.policy.evaluate import EvaluationConfig
from terrainkit_robots.report_card import limits as limits_module
from terrainkit_robots.report_card.crossing import CROSSED, FELL, Attempts
from terrainkit_robots.report_card.limits import LEVELS, limit_rows, limit_tests, measure_limits

LIMITS = RobotLimits(
    step_up=0.2,
    step_down=0.25,
    gap=0.4,
    slope=0.577,
    foothold=0.1,
    body_width=0.4,
    standing_height=0.6,
    crouched_height=0.35,
)


@pytest.fixture
def measure(monkeypatch):
    """Return a function that measures a policy that crosses the levels up to a highest one."""

    def run(highest):
        class Known:
            def __init__(self, _, terrain_map, num_envs, __):
                assert terrain_map.difficulty.shape == (1, len(highest))
                self.num_envs, parameters = num_envs, terrain_map.parameters[0].tolist()
                self.values = [
                    each.requested[test.parameter]
                    for each, test in zip(parameters, limit_tests(LIMITS), strict=True)
                ]

            def attempt(self, levels, columns):
                assert len(levels) == len(columns) == self.num_envs
                ok = np.zeros(len(columns), bool)
                for k, column in enumerate(columns):
                    test = limit_tests(LIMITS)[column]
                    step = (test.hard - test.easy) / (LEVELS - 1)
                    level = (self.values[column] - test.easy) / step
                    ok[k] = level < highest[column] + 0.5
                outcomes = np.where(ok, CROSSED, FELL).astype(np.int8)
                return Attempts(outcomes=outcomes, seconds=np.zeros(len(levels)))

        monkeypatch.setattr(limits_module, "Crossing", Known)
        return measure_limits(None, LIMITS, 2, EvaluationConfig())

    return run


@pytest.mark.parametrize("highest", [-1, 0, 1, 9, 10, 18, 19])
def test_bisection_finds_the_hardest_level(measure, highest):
    step_up, *_ = measure([highest] * 9)
    values = 0.02 + 0.38 * np.arange(LEVELS) / (LEVELS - 1)  # 0.1 to 2 times 0.2 m
    if highest < 0:
        assert step_up.passed is None
    else:
        assert step_up.passed == pytest.approx(values[highest], abs=1e-6)
    if highest < LEVELS - 1:
        assert step_up.failed == pytest.approx(values[highest + 1], abs=1e-6)
        assert step_up.crossed == 0
    else:
        assert step_up.failed is None


def test_limits_are_printed_with_units(measure):
    results = measure([9, 9, 9, 9, 9, 9, -1, 19, 9])
    rows = {row[0]: row[1:] for row in limit_rows(results, 2)}
    assert rows["test"] == ("2 of 2 cross", "next value", "limit of the robot")
    assert rows["step up"] == ("20.0 cm", "0 of 2 at 22.0 cm", "20.0 cm")
    assert rows["slope up and down"][2] == "30 degrees"
    assert rows["clearance"] == ("none", "0 of 2 at 72.0 cm", "35.0 cm")
    assert rows["stone"][1] == "-"


def test_slopes_across_are_as_steep_as_slopes_up(measure):
    results = {each.test: each for each in measure([19] * 9)}
    steepest = math.degrees(math.atan(2 * 0.577))
    assert results["slope across"].passed == pytest.approx(steepest)
    assert results["slope up and down"].passed == pytest.approx(steepest)
