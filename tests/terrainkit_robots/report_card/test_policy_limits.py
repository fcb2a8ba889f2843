import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

from terrainkit import generate
from tests.limits import LIMITS as SHARED_LIMITS
from tests.tables import read_table

pytest.importorskip("torch", reason="the extra `train` is not installed")

from terrainkit_robots.policy.evaluate import EvaluationConfig
from terrainkit_robots.policy.result_table import ResultTable
from terrainkit_robots.report_card import policy_limits as limits_module
from terrainkit_robots.report_card.crossing import CROSSED, FELL
from terrainkit_robots.report_card.policy_limits import (
    LimitResult,
    limit_cell,
    limit_rows,
    limit_tests,
    limits_config,
    measure_limits,
)
from terrainkit_robots.report_card.success_curve import fit_success
from terrainkit_robots.rl.run import open_run

LIMITS = dataclasses.replace(SHARED_LIMITS, slope=0.577, crouched_height=0.35)


@pytest.fixture
def measure(monkeypatch):
    """Return a function that measures a policy that crosses up to a hardness.

    One of ten robots always fails if `lapse` is set.
    """

    def run(highest, limits=LIMITS, lapse=0):
        class Known:
            def __init__(self, _, terrain_map, num_envs, config, scale):
                assert scale == 1.0
                assert terrain_map.difficulty.shape == (1, len(highest))
                seeds.append(config.seed)
                self.num_envs, self.hardness = num_envs, []
                parameters = terrain_map.parameters[0].tolist()
                for each, test in zip(parameters, limit_tests(limits), strict=True):
                    easy, hard = test.values
                    self.hardness.append((each.requested[test.parameter] - easy) / (hard - easy))
                assert -1e-9 <= min(self.hardness) <= max(self.hardness) <= 1 + 1e-9

            def attempt(self, levels, columns):
                assert len(levels) == len(columns) == self.num_envs
                ok = np.array(self.hardness)[columns] <= np.array(highest)[columns]
                ok &= np.arange(len(columns)) % 10 >= lapse
                outcomes = np.where(ok, CROSSED, FELL).astype(np.int8)
                return SimpleNamespace(outcomes=outcomes)

        seeds = []
        monkeypatch.setattr(limits_module, "Crossing", Known)
        table = measure_limits(open_run("quadruped"), limits, 10, EvaluationConfig(seed=3))
        assert seeds == [3, 4, 5, 6, 7, 8]  # other starts in each round
        return table

    return run


def test_limits_are_between_the_values_that_were_crossed_and_those_that_were_not(measure):
    highest = np.linspace(0.1, 0.9, 11)
    results = measure(highest)["limits"]
    for result, test, hardness in zip(results, limit_tests(LIMITS), highest, strict=True):
        easy, hard = result.tested
        span, value = hard - easy, test.value(hardness)
        tolerance = 0.15 if test.parameter == "length" else 0.08  # gaps are whole cells
        at_50, low, high = result.at_50
        assert abs(at_50 - value) <= tolerance * abs(span)
        assert low / span <= at_50 / span <= high / span
        assert result.at_90[0] / span <= at_50 / span
        assert sum(starts for _, _, starts in result.counts) == 60
        near = (starts for at, _, starts in result.counts if abs((at - value) / span) < 0.2)
        assert sum(near) >= 24
        assert list(result.counts) == sorted(result.counts, reverse=easy > hard)


def test_limits_beyond_the_tested_values_are_bounds(measure):
    rows = limit_rows(measure([1, -1] * 5 + [1]))
    header = ("test", "90 % cross", "50 % cross", "in legs", "crossed", "limit of the robot")
    assert rows[0] == header
    by_test = {row[0]: row[1:4] for row in rows}
    # Twice the limit of 20 cm.
    assert by_test["step up"][:2] == 2 * ("> 40.0 cm (> 40.0 to > 40.0)",)
    assert by_test["step down"][:2] == 2 * ("< 2.5 cm (< 2.5 to < 2.5)",)
    assert by_test["one bar"][:2] == 2 * ("> 72.0 cm (> 72.0 to > 72.0)",)  # not the highest one
    assert by_test["corridor"][1] == "< 20.0 cm (< 20.0 to < 20.0)"  # also the narrowest one
    assert by_test["slope across"][2] == ""
    assert rows[1][3] == "> 0.89, > 0.89"  # 0.4 m of 0.448 m
    assert rows[1][4] == "10/10 at 20.8, 10/10 at 36.6, 40/40 at 40.0"


def test_lapses_do_not_move_the_limit(measure):
    """Nine of ten cross everything up to half of the values."""
    (result, *_) = measure([0.5] * 11, lapse=1)["limits"]
    assert result.at_50[0] == pytest.approx(0.21, abs=0.02)
    assert result.at_90[1] == pytest.approx(0.02)  # the easiest: the success may be below 90 %


def test_limits_of_a_robot_with_long_legs():
    tests = limit_tests(dataclasses.replace(LIMITS, gap=1.2))[3:5]
    assert [test.values for test in tests] == [pytest.approx((0.1, 2.0))] * 2
    assert generate(limits_config(tests, [1, 1], 5)).difficulty.shape == (1, 2)


@pytest.mark.parametrize("leg", [0.02, 0.1, 0.29])
def test_patches_shrink_with_short_legs(leg):
    """A robot with legs of 0.4 m and the same one, smaller, have the same limits in legs."""
    lengths = {f.name: getattr(LIMITS, f.name) for f in dataclasses.fields(LIMITS)}
    for name in ("slope", "friction", "turning_width"):
        del lengths[name]
    scaled = {name: value and value * leg / 0.4 for name, value in lengths.items()}
    cell = limit_cell(leg)
    tests = limit_tests(dataclasses.replace(LIMITS, **scaled), cell)
    for large, small in zip(limit_tests(LIMITS), tests, strict=True):
        if small.unit == "m":
            rounding = 2 * cell if small.parameter in {"length", "corridor"} else 0.2 * cell
            for value, size in zip(small.values, large.values, strict=True):
                assert value == pytest.approx(size * leg / 0.4, abs=rounding)
    for hardness in (0.0, 0.5, 1.0):
        patches = generate(limits_config(tests, [hardness] * len(tests), 5, cell))
        assert patches.difficulty.shape == (1, 11)


def test_limits_of_a_small_robot_are_in_millimeters():
    result = LimitResult(
        test="step up",
        unit="m",
        tested=(0.004, 0.08),
        at_90=(0.02, 0.01, 0.03),
        at_50=(0.025, 0.02, 0.08),
        counts=((0.02, 9, 10),),
        robot_limit=0.04,
    )
    table = ResultTable(about={"leg_length": 0.1}, tables={"limits": [result]}, schema_version=2)
    assert limit_rows(table)[1] == (
        "step up",
        "20.0 mm (10.0 to 30.0)",
        "25.0 mm (20.0 to > 80.0)",
        "0.20, 0.25",
        "9/10 at 20.0",
        "40.0 mm",
    )


def test_slopes_across_are_as_steep_as_slopes_up():
    results = {each.name: each.value(1.0) for each in limit_tests(LIMITS)}
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
    assert tests["four bars"][1] == pytest.approx(0.02)


def test_map_of_limits_has_a_patch_for_each_test():
    hardness = [0, 1, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8]
    terrain_map = generate(limits_config(limit_tests(LIMITS), hardness, 5))
    assert (terrain_map.difficulty.shape, terrain_map.config.seed) == ((1, 11), 5)
    parameters = [each.requested for each in terrain_map.parameters[0].tolist()]
    assert parameters[0]["depth"] == pytest.approx(0.02)
    assert parameters[1]["step_height"] == pytest.approx(0.5)
    assert parameters[2]["step_height"] == pytest.approx(0.039)  # 0.02 + 0.05 * 0.38
    goals = [len(terrain_map.patch(0, col).goals) for col in range(11)]
    assert goals[3:5] == [1, 4]
    assert goals[7:9] == [1, 4]


@pytest.mark.parametrize(
    ("hardness", "crossed", "at_50"),
    [
        ([0.4, 0.6], [10, 0], 0.5),  # symmetric
        ([0.2, 0.4, 0.5, 0.6, 0.8], [10, 8, 5, 2, 0], 0.5),
        ([0.1, 0.2, 0.3, 0.4, 0.5, 0.6], [9, 9, 9, 9, 9, 0], 0.55),  # 9 of 10 up to 0.5
        ([0.5, 1.0], [10, 10], 1.0),
        ([0.0, 0.5], [0, 0], 0.0),
    ],
)
def test_curve_crosses_half_where_half_of_the_robots_cross(hardness, crossed, at_50):
    fit = fit_success(hardness, crossed, 10)
    assert fit[0.5][0] == pytest.approx(at_50, abs=0.02)
    for median, low, high in fit.values():
        assert 0 <= low <= median <= high <= 1
    assert np.all(fit[0.9] <= fit[0.5])


def test_curve_is_harder_with_more_successes_and_surer_with_more_starts():
    few, more = (fit_success([0.2, 0.5, 0.8], [10, n, 0], 10) for n in (3, 7))
    assert np.all(few[0.5] < more[0.5])
    _, low, high = fit_success([0.2, 0.5, 0.8], [40, 12, 0], 40)[0.5]
    assert high - low < few[0.5][2] - few[0.5][1]
