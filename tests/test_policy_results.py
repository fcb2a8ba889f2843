"""Tests of the results of policies that the page docs/policy_results.md lists."""

import json
from pathlib import Path

import pytest
from scipy.stats import binomtest

import terrainkit

FILES = sorted((Path(__file__).parents[1] / "benchmarks/results/policies").glob("*.json"))


def wilson(crossed, attempts):
    return list(binomtest(crossed, attempts).proportion_ci(method="wilson"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_result_has_a_suite_a_source_and_the_shares_of_its_attempts(path):
    card = json.loads(path.read_text())
    assert path.stem == f"{card['policy']}-{card['map']}"
    assert all(card[key] for key in ("source", "terrainkit", "robot"))
    assert card["sha256"] == terrainkit.get_suite(card["map"]).sha256
    names = [choice.name for choice in terrainkit.get_suite(card["map"]).config.terrains]
    assert [test["name"] for test in card["tests"]] == names
    outcomes = [level["outcomes"] for test in card["tests"] for level in test["levels"]]
    total = wilson(sum(o["crossed"] for o in outcomes), sum(sum(o.values()) for o in outcomes))
    assert card["interval"] == pytest.approx(total, abs=1e-5)
    for test in card["tests"]:
        crossed = [level["outcomes"]["crossed"] for level in test["levels"]]
        attempts = [sum(level["outcomes"].values()) for level in test["levels"]]
        assert set(attempts) == {card["repetitions"]}
        assert test["success"] == pytest.approx(sum(crossed) / sum(attempts), abs=1e-5)
        assert test["interval"] == pytest.approx(wilson(sum(crossed), sum(attempts)), abs=1e-5)
        passed = [k for k, n in enumerate(crossed) if crossed[: k + 1] == attempts[: k + 1]]
        assert test["passed"] == (passed[-1] if passed else None)
    mean = sum(test["success"] for test in card["tests"]) / len(names)
    assert card["success"] == pytest.approx(mean, abs=1e-5)
