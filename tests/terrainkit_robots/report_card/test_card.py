import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("torch", reason="the extra `train` is not installed")

from terrainkit import MapConfig, SubTerrain, generate, suite_hash
from terrainkit.errors import ConfigError
from terrainkit_robots.policy.evaluate import EvaluationConfig
from terrainkit_robots.report_card import card as card_module
from terrainkit_robots.report_card.card import card_markdown, card_rows, measure, summary
from terrainkit_robots.report_card.crossing import CROSSED, FELL, TIMED_OUT, Crossing
from terrainkit_robots.report_card.picture import draw_card
from terrainkit_robots.rl.run import open_run


def make_map(*terrains, rows=3, size=(5.0, 4.0)):
    return generate(
        MapConfig(
            rows=rows, cols=len(terrains), patch_size=size, border=2.0, terrains=terrains, seed=1
        )
    )


@pytest.fixture(scope="module")
def quadruped_run():
    """The bundled policy."""
    return open_run("quadruped")


@pytest.fixture(scope="module")
def slopes_and_pits():
    slope = SubTerrain(terrain="slope", parameters={"grade": (0.0, 0.2), "landing": 1.4})
    pit = SubTerrain(terrain="pit", parameters={"depth": (0.0, 1.0), "side": 2.0})
    return make_map(slope, pit)


@pytest.fixture
def make_card(monkeypatch, quadruped_run, slopes_and_pits):
    """Return a function that makes a card from outcomes of shape (rows, repetitions) by column."""

    def make(*columns, terrain_map=slopes_and_pits):
        class Known(Crossing):
            def __init__(self, *_):
                self.speed = 0.75

            def attempt(self, levels, columns_of):
                outcomes = np.array(columns[columns_of[0]], np.int8).ravel()
                seconds = np.where(outcomes == CROSSED, 4.0 + levels, np.nan)
                return SimpleNamespace(outcomes=outcomes, seconds=seconds)

        monkeypatch.setattr(card_module, "Crossing", Known)
        number = len(columns[0][0])
        return measure(quadruped_run, terrain_map, "test-1", number, EvaluationConfig(seed=3))

    return make


def test_passed_level_has_the_friction_of_the_ground(make_card):
    grade, ok = {"grade": (0.0, 0.2), "landing": 1.4}, [CROSSED, CROSSED]
    slopes = [
        SubTerrain(terrain="slope", name=name, parameters=grade, friction=friction)
        for name, friction in (("dry", None), ("wet", 0.25), ("icy", (0.5, 0.1)))
    ]
    card = make_card(*[[ok, ok, ok]] * 3, terrain_map=make_map(*slopes))
    texts = [test.passed_text for test in card["tests"]]
    assert texts == ["2: grade 0.2", "2: grade 0.2, friction 0.25", "2: grade 0.2, friction 0.1"]
    assert [level.parameters["friction"] for level in card["tests"][2].levels] == [0.5, 0.3, 0.1]


def test_level_is_passed_with_every_easier_one(make_card):
    ok, fell, late = CROSSED, FELL, TIMED_OUT
    card = make_card([[ok, ok], [ok, fell], [ok, ok]], [[late, fell], [ok, ok], [ok, ok]])
    slope, pit = card["tests"]
    assert (slope.name, slope.passed, slope.passed_text) == ("slope", 0, "0: grade 0")
    assert (pit.name, pit.passed, pit.passed_text) == ("pit", None, "none")
    assert (slope.success, card.about["success"]) == (pytest.approx(5 / 6), pytest.approx(9 / 12))
    assert slope.levels[1].outcomes == {"crossed": 1, "fell": 1, "left": 0, "timed out": 0}
    assert slope.levels[1].parameters == {"grade": pytest.approx(0.1)}
    assert [each.seconds for each in slope.levels] == [4.0, 5.0, 6.0]
    assert [each.seconds for each in pit.levels] == [None, 5.0, 6.0]
    assert tuple(card.about[key] for key in ("repetitions", "seed", "speed")) == (2, 3, 0.75)


def test_hardest_level_can_be_passed(make_card):
    ok, fell = CROSSED, FELL
    slope, pit = make_card([[ok, ok]] * 3, [[ok, ok], [ok, ok], [ok, fell]])["tests"]
    assert (slope.passed, slope.success, pit.passed) == (2, 1.0, 1)


def test_columns_of_the_same_terrain_have_numbers(make_card):
    depth = {"depth": (0.0, 0.1234), "side": 2.0}
    pit = SubTerrain(terrain="pit", parameters=depth, proportion=2.0)
    config = make_map(pit, SubTerrain(terrain="flat"), rows=2).config
    terrain_map = generate(replace(config, cols=3))
    card = make_card(*[[[FELL]] * 2] * 3, terrain_map=terrain_map)
    assert [test.name for test in card["tests"]] == ["pit 0", "pit 1", "flat"]
    assert replace(card["tests"][0], passed=1).passed_text == "1: depth 0.123"


def test_intervals_are_those_of_wilson(make_card):
    """10 of 10: 1 / (1 + 1.96^2 / 10) to 1."""
    card = make_card([[CROSSED] * 10] * 3, [[FELL] * 10] * 3)
    low, high = card["tests"][0].levels[0].interval
    assert low == pytest.approx(1 / (1 + 1.96**2 / 10), abs=1e-4)
    assert high == pytest.approx(1.0)
    assert card["tests"][0].passed_text == "2: grade 0.2"
    assert card["tests"][1].levels[0].interval == pytest.approx((0.0, 1 - low), abs=1e-9)


def test_card_is_written_as_json_markdown_and_picture(make_card, slopes_and_pits):
    card = make_card([[CROSSED, CROSSED], [CROSSED, FELL], [FELL, FELL]], [[FELL, FELL]] * 3)
    assert card.about["sha256"] == suite_hash(slopes_and_pits)
    name = open_run("quadruped").checkpoint.name
    assert summary(card) == f"quadruped, {name}, on test-1: success 25% (9% to 53%)"
    row = ("slope", "2", "1", "0", "50% (19% to 81%)", "0: grade 0")
    assert card_rows(card)[:2] == [("test", "level 0", "1", "2", "success", "passed level"), row]
    document = json.loads(card.to_json())
    assert (document["schema_version"], document["margins"]) == (1, None)
    assert document["tests"][0]["levels"][1]["outcomes"]["crossed"] == 1
    text = card_markdown(card)
    assert text.startswith("# quadruped on test-1\n")
    assert f"| {' | '.join(row)} |" in text
    assert "A level is passed if all robots cross it and every easier level." in text
    assert draw_card(card).startswith(b"\x89PNG")


def test_bundled_policy_crosses_slopes_and_stays_in_deep_pits(quadruped_run, slopes_and_pits):
    """The real policy in MuJoCo."""
    card = measure(quadruped_run, slopes_and_pits, "test-1", 2, EvaluationConfig())
    slope, pit = card["tests"]
    assert slope.passed == 2
    assert 4.5 < slope.levels[0].seconds < 1.5 * 4.3 / 0.75 + 5
    assert pit.passed == 0
    assert pit.levels[2].outcomes["crossed"] == 0
    assert measure(quadruped_run, slopes_and_pits, "test-1", 2, EvaluationConfig()) == card


@pytest.mark.parametrize("part", [{"lin_vel_x": (-1.0, 0.0)}, {"ang_vel_yaw": (0.0, 0.0)}])
def test_task_that_does_not_walk_ahead_or_turn_is_rejected(quadruped_run, slopes_and_pits, part):
    commands = replace(quadruped_run.task.commands, **part)
    run = replace(quadruped_run, task=replace(quadruped_run.task, commands=commands))
    with pytest.raises(ConfigError, match="expected a task to walk ahead and turn both ways"):
        measure(run, slopes_and_pits, "test-1", 1, EvaluationConfig())
