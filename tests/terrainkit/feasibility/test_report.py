from dataclasses import replace

import numpy as np
import pytest

from terrainkit.feasibility.assess import PatchFeasibility
from terrainkit.feasibility.report import (
    blocking_text,
    crossed_texts,
    demand_table,
    demand_text,
    routes,
    to_json,
)
from tests.limits import LIMITS
from tests.tables import read_table

EASY = PatchFeasibility(
    row=0,
    col=0,
    terrain="stairs",
    difficulty=0.5,
    demand=0.75,
    limit="step_up",
    value=0.15,
    place=np.array([1.0, 2.00004, 0.075]),
    path=np.array([[0.0, 2.0, 0.0], [2.0, 2.0, 0.15]]),
)
LOST = replace(
    EASY, row=2, demand=np.inf, limit="", value=np.nan, place=np.full(3, np.nan), path=EASY.path[:1]
)


@pytest.mark.parametrize(
    ("demand", "text"),
    [(0.0, "0.00"), (1.0, "1.00"), (1.0001, "1.01"), (1.02, "1.02"), (np.inf, "inf")],
)
def test_only_a_passable_demand_is_1(demand, text):
    assert demand_text(demand) == text


def test_table_has_the_largest_demand_of_each_terrain_and_row():
    other = replace(EASY, terrain="gap", demand=0.5)
    assert demand_table([EASY, replace(EASY, demand=0.25), other, LOST]) == [
        ("terrain", "level 0", "2"),
        ("stairs", "0.75", "inf"),
        ("gap", "0.50", "-"),
    ]


def test_patches_are_counted_up_to_the_easiest_that_is_not_passable():
    def patches(**demands):
        return [
            replace(EASY, terrain=name, difficulty=k / 4, demand=demand)
            for name, each in demands.items()
            for k, demand in enumerate(each)
        ]

    results = patches(stairs=[0, 1, 1.001, 1, np.inf], gap=[0.5, 1], pit=[2, 0.5])
    assert crossed_texts(results) == [
        "stairs: 3 of 5 patches, up to difficulty 0.25",
        "gap: 2 of 2 patches, up to difficulty 0.25",
        "pit: 1 of 2 patches",
    ]
    assert to_json(results, results, LIMITS)["terrains"]["pit"] == {
        "patches": 2,
        "passable": 1,
        "max_difficulty": None,
    }


def test_blocking_text_has_value_limit_and_place():
    place = "at (1.00, 2.00, 0.07)"
    assert blocking_text(EASY, LIMITS) == f"step_up 0.15 m (limit 0.2 m) {place}"
    slope, slip = (replace(EASY, limit=name, value=0.7) for name in ("slope", "friction"))
    assert blocking_text(slope, LIMITS) == f"slope 0.7 (limit 0.5) {place}"
    assert blocking_text(slip, LIMITS) == f"friction 0.7 (limit 0.667) {place}"
    assert blocking_text(LOST, LIMITS) == "no path"
    assert blocking_text(replace(LOST, demand=0.0), LIMITS) == "level"


def test_json_has_null_for_what_is_not_finite():
    report = to_json([EASY, LOST], [EASY, LOST], LIMITS, robot="a")
    patches = report.pop("patches")
    limits = report.pop("limits")
    counts = {"patches": 2, "passable": 1, "max_difficulty": None}
    assert report.pop("terrains") == {"stairs": counts}
    assert report == {"schema_version": 1, "robot": "a", "max_demand": 2.0, "passable": False}
    assert limits == vars(LIMITS)
    assert patches[0] == read_table(__file__, "json_has_null_for_what_is_not_finite")
    none = {"demand": None, "passable": False, "limit": None, "value": None, "place": None}
    none |= {"walking_demand": None, "walking_limit": None}
    assert patches[1] == patches[0] | none | {"row": 2, "path": [[0.0, 2.0, 0.0]]}
    assert to_json([EASY], [LOST], LIMITS)["passable"]


def test_routes_have_path_mark_and_label():
    easy, lost = routes([EASY, LOST])
    assert easy.points.tolist() == [[0.0, 2.0], [2.0, 2.0]]
    assert (easy.place, easy.label, easy.is_passable) == ((1.0, 2.00004), "0.75", True)
    assert (lost.place, lost.label, lost.is_passable) == ((0.0, 2.0), "no path", False)
    (far,) = routes([replace(EASY, demand=np.inf)])
    assert (far.place, far.label) == ((1.0, 2.00004), "> 2")
