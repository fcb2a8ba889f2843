"""Presets of published work against what the work builds, or against its figures.

works.json has numbers of the ground that the functions of a work build, which
tests/frameworks/works_check.py writes; `different` in the TOML file lists those that are not as in
the work. For work without public code, `sources` has every parameter that a preset gives, written
anew from the source: [easy, hard] where it depends on the difficulty.
"""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import terrainkit as tk
from terrainkit.errors import ConfigError
from terrainkit.map.validate import validate
from terrainkit.terrain.paper import get_paper, paper_names
from tests.ground_numbers import MEASURES
from tests.tables import read_table

SOURCES = read_table(__file__, "sources")
DIFFERENT = read_table(__file__, "different")
WORKS = json.loads(Path(__file__).with_name("works.json").read_text(encoding="utf-8"))


def config_of(name, **values):
    """Return the config of the map of a work, with other values."""
    return tk.MapConfig.from_table({"preset": name, "border": 0.0, **get_paper(name).map, **values})


@pytest.mark.parametrize("name", sorted(SOURCES))
def test_paper_without_code_realizes_the_figures_of_its_source(name):
    grid = config_of(name).patch_grid(0, 0)
    given = {}
    for sub_terrain in get_paper(name).terrains:
        source = given[sub_terrain.name] = SOURCES[name][sub_terrain.name]
        assert sub_terrain.parameters.keys() == source.keys(), sub_terrain.name
        for end, difficulty in enumerate((0.0, 1.0)):
            realized = sub_terrain.at(difficulty).realized(grid)
            for key, value in source.items():
                expected = value[end] if isinstance(value, list) else value
                snap = sub_terrain.declarations[key].snap
                step = {"none": 1e-4, "cells": grid.cell / 2, "centered": grid.cell}[snap] + 1e-6
                assert realized[key] == pytest.approx(expected, abs=step), (sub_terrain.name, key)
    assert given == SOURCES[name]


LENGTHS = {"edge", "tread", "platform", "platform_diagonal", "side", "stone", "gap"}
LENGTHS |= {"start", "length", "pitch", "width", "strip", "offset", "opening"}


def is_near(key, ours, works, cell):
    """Return whether numbers agree: lengths by a cell, heights by 1 cm and 10 %, counts exactly."""
    if key in LENGTHS:
        return ours == pytest.approx(works, abs=cell + 1e-3)
    if key in ("rises", "up", "down", "number"):
        return ours == works
    return ours == pytest.approx(works, abs=0.03 if key in ("level", "holes") else 0.01, rel=0.1)


def ground_of(name, terrain, difficulty, seed):
    """Return heights at the centers of the cells of one patch [m], and the corners of its boxes."""
    terrain_map = one_patch(name, terrain, difficulty, seed)
    grid = terrain_map.config.patch_grid(0, 0)
    x, y = np.meshgrid(grid.axis(0), grid.axis(1), indexing="ij")
    if WORKS[name]["terrains"][terrain]["measure"] != "bars":
        return terrain_map.scan(np.dstack([x, y, np.full_like(x, 20.0)]))
    boxes = terrain_map.solids.boxes.astype(float)
    half = boxes[:, 3:6]
    return None, np.stack([boxes[:, :3] - half, boxes[:, :3] + half], axis=1)


@pytest.mark.parametrize(
    ("name", "terrain"),
    [(name, terrain) for name, work in WORKS.items() for terrain in work["terrains"]],
)
def test_paper_builds_what_the_work_builds(name, terrain):
    work = WORKS[name]["terrains"][terrain]
    cell = max(WORKS[name]["layout"]["cell"], config_of(name).cell)
    num_seeds = 1 if work["measure"] in ("slope", "around_center") else 5
    different = set()
    for level, numbers in work["numbers"].items():
        grounds = [ground_of(name, terrain, float(level), seed) for seed in range(num_seeds)]
        ours = MEASURES[work["measure"]](grounds, config_of(name).cell)
        different |= {key for key in numbers if not is_near(key, ours[key], numbers[key], cell)}
    assert different == {*DIFFERENT[name].get(terrain, ())}


def one_patch(name, terrain, difficulty, seed=0):
    """Return a map of one patch of a work."""
    (sub_terrain,) = (each for each in get_paper(name).terrains if each.name == terrain)
    keys = ("patch_size", "cell", "slope_threshold")
    size = {key: value for key, value in get_paper(name).map.items() if key in keys}
    one = {"rows": 1, "cols": 1, "mode": "selected", "selected_difficulty": difficulty}
    config = tk.MapConfig(**size, **one, border=1.0, terrains=(sub_terrain,), seed=seed)
    return tk.generate(config)


def rays(terrain_map, axis=0, at=None, start=20.0, direction="down"):
    """Return where rays every 5 mm along a line through the patch end."""
    size = terrain_map.config.patch_size
    line = np.arange(0.0025, size[axis], 0.005)
    across = np.full_like(line, size[1 - axis] / 2 if at is None else at)
    points = np.column_stack([*((line, across) if axis == 0 else (across, line)), 0 * line + start])
    return terrain_map.scan(points, direction)


def lengths(is_inside):
    """Return the lengths of the runs of True, 5 mm each, without the runs at both ends."""
    edges = np.flatnonzero(np.diff(is_inside.astype(int)))
    runs = np.diff(edges) * 0.005
    return runs[is_inside[edges[:-1] + 1]]


@pytest.mark.parametrize(
    ("name", "terrain", "easy", "hard"),
    [
        *read_table(__file__, "paper_gaps_have_their_length_by_rays"),
        ("risky_terrains", "stepping_beams", 0.15, None),  # turned at difficulty 1
    ],
)
def test_paper_gaps_have_their_length_by_rays(name, terrain, easy, hard):
    for difficulty, length in ((0.0, easy), (1.0, hard)):
        if length is not None:
            gaps = lengths(rays(one_patch(name, terrain, difficulty)) < -0.2)
            assert gaps[:-1] == pytest.approx(length, abs=0.006)  # the last one ends at a cell
            assert len(gaps) > 1


@pytest.mark.parametrize(
    ("name", "terrain", "difficulty", "levels"),
    read_table(__file__, "paper_obstacles_have_their_height_by_rays"),
)
def test_paper_obstacles_have_their_height_by_rays(name, terrain, difficulty, levels):
    z = rays(one_patch(name, terrain, difficulty))
    assert [z.min(), z.max()] == pytest.approx([levels[0], levels[-1]], abs=2e-3)
    if terrain != "a_frame":
        assert np.unique(z.round(4)).tolist() == pytest.approx(levels)


def test_paper_openings_and_ramps_by_rays():
    for difficulty, clearance in ((0.0, 0.5), (1.0, 0.25)):
        bars = rays(one_patch("robot_parkour_learning", "crawl", difficulty), 0, None, 0.01, "up")
        assert np.nanmin(bars) == pytest.approx(clearance)
    ramp = rays(one_patch("extreme_parkour", "side_ramps", 1.0), 1, at=3.2)
    on_ramp = ramp[20:-20][ramp[20:-20] > -0.5]  # without the rim of the pit
    assert [on_ramp.min(), on_ramp.max()] == pytest.approx([-0.25, 0.25], abs=2e-3)
    assert len(on_ramp) * 0.005 == pytest.approx(1.0)
    stones = lengths(rays(one_patch("beamdojo", "stone_rows", 1.0), at=4.15) > -0.5)
    assert stones[1:-1] == pytest.approx(0.2, abs=0.006)
    wedge = lengths(rays(one_patch("barkour", "a_frame", 1.0)) > 1e-3)
    assert wedge == pytest.approx(3.2, abs=0.106)  # a slope starts at the center of a cell


@pytest.mark.parametrize("name", paper_names())
def test_paper_generates_as_in_the_work_with_valid_origins(name):
    terrain_map = tk.generate(config_of(name, rows=2, cols=20, border=1.0))
    assert validate(terrain_map) == []


def test_paper_citations_are_complete():
    for paper in map(get_paper, paper_names()):
        assert min(len(paper.title), len(paper.authors), len(paper.figures)) > 4
        assert 2020 < paper.year < 2027
        assert re.match(r"arXiv:\d{4}\.\d{5}$|doi:10\.|https://", paper.source)
        assert {*paper.second_hand} <= {each.name for each in paper.terrains}


def test_get_paper_unknown_name_lists_papers():
    with pytest.raises(ConfigError, match="'ame'; did you mean 'ame_2'"):
        get_paper("ame")
