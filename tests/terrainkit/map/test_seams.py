import warnings
from dataclasses import replace

import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, TerrainkitWarning, generate
from terrainkit.map.seams import Seam, Seams, cliffs_text, seam_text
from terrainkit.overlays.side_walls import SideWalls
from terrainkit.terrain import presets

SMALL = MapConfig(
    rows=2,
    cols=3,
    patch_size=(8.0, 4.0),
    border=0.4,
    cell=0.2,
    terrains=(SubTerrain(terrain="flat"),),
)


def seams_of(terrain_map):
    return Seams(terrain_map=terrain_map)


def raised(config, *blocks):
    """Return the seams of a flat map with raised blocks of samples (x, y, height)."""
    heights = np.zeros(config.grid.shape, dtype=np.float32)
    for x, y, height in blocks:
        heights[x, y] = height
    return seams_of(replace(generate(config), heights=heights))


# The border has 2 samples; patches have 40 x 20.
@pytest.mark.parametrize(
    ("block", "patches"),
    [
        ((41, 10), ((0, 0), (1, 0))),
        ((42, 10), ((0, 0), (1, 0))),
        ((60, 21), ((1, 0), (1, 1))),
        ((60, 22), ((1, 0), (1, 1))),
        ((2, 30), (None, (0, 1))),
        ((81, 30), ((1, 1), None)),
        ((60, 2), (None, (1, 0))),
        ((60, 61), ((1, 2), None)),
    ],
)
def test_largest_seam_is_between_these_patches(block, patches):
    found = raised(SMALL, (*block, 0.25)).largest()
    assert found == Seam(height=0.25, patches=patches)


def test_largest_seam_ignores_steps_within_patches():
    assert raised(SMALL, (20, 12, 3.0)).largest().height == 0.0


def test_map_of_one_patch_without_border_has_no_seam():
    config = MapConfig(rows=1, cols=1, border=0.0, terrains=(SubTerrain(terrain="flat"),))
    found = raised(config)
    assert found.largest() is None
    assert found.cliffs() == []


def test_map_without_border_has_inner_seams_only():
    config = MapConfig(rows=2, cols=2, border=0.0, terrains=(SubTerrain(terrain="flat"),))
    assert raised(config, (0, slice(None), 1.0)).largest().height == 0.0
    found = raised(config, (80, 20, 1.0)).largest()
    assert found == Seam(height=1.0, patches=((0, 0), (1, 0)))


def test_cliff_is_higher_than_steps_within_patches():
    # Patch (0, 0) is a block of 1 m: no step within it.
    block = (slice(2, 42), slice(2, 22), 1.0)
    assert {seam.patches for seam in raised(SMALL, block).cliffs()} == {
        ((0, 0), (1, 0)),
        ((0, 0), (0, 1)),
        (None, (0, 0)),
    }
    # A post of 1 m at the edge is a step of 1 m within its patch.
    assert raised(SMALL, (2, 10, 1.0)).cliffs() == []
    assert raised(SMALL, (slice(2, 42), slice(2, 22), 0.5)).cliffs() == []


@pytest.mark.parametrize(("sides", "walled"), [("both", True), ("one", False)])
def test_seam_between_walls_is_no_cliff(sides, walled):
    walls = SideWalls(probability=1.0, height=1.0)
    high = SubTerrain(terrain="stairs", overlays=(walls,))
    low = SubTerrain(terrain="flat", overlays=(walls,) if sides == "both" else ())
    config = MapConfig(rows=2, cols=2, border=0.0, terrains=(high, low))
    with warnings.catch_warnings():
        warnings.simplefilter("error" if walled else "ignore")
        cliffs = seams_of(generate(config)).cliffs()
    assert (cliffs == []) == walled


def test_cliffs_are_sorted_by_height():
    blocks = [(slice(2, 42), slice(2, 22), 1.0), (slice(42, 82), slice(42, 62), 2.0)]
    assert [s.height for s in raised(SMALL, *blocks).cliffs()] == [2.0] * 4 + [1.0] * 4


@pytest.mark.parametrize("size", [(8.0, 8.0), (8.0, 4.0), (12.0, 6.0), (8.0, 16.0)])
@pytest.mark.parametrize("preset", ["legged_gym", "rough"])
@pytest.mark.filterwarnings("ignore:cells of:terrainkit.TerrainkitWarning")
def test_presets_have_no_cliffs(preset, size):
    config = MapConfig(rows=3, cols=10, preset=preset, patch_size=size, border=1.0)
    assert seams_of(generate(config)).cliffs() == []


@pytest.mark.parametrize("preset", presets.preset_names())
def test_presets_meet_at_the_same_height_along_x(preset):
    # Proportions below or above 1 need more columns.
    cols = {"legged_gym_rough": 20, "parkour_course": 10}.get(preset)
    cols = cols or len(presets.get_preset(preset))
    config = MapConfig(rows=3, cols=cols, preset=preset, border=1.0)
    cliffs = seams_of(generate(config)).cliffs()
    # Only the sides of straight slopes and stairs are cliffs.
    inner = [seam.patches for seam in cliffs if None not in seam.patches]
    assert [(first, second) for first, second in inner if first[1] == second[1]] == []


def test_equal_stairs_meet_at_the_same_height():
    stairs = SubTerrain(terrain="stairs")
    terrain_map = generate(MapConfig(rows=3, cols=2, border=0.0, terrains=(stairs,)))
    assert seams_of(terrain_map).largest().height == 0.0


def test_generate_warns_of_cliffs():
    terrains = (SubTerrain(terrain="stairs"), SubTerrain(terrain="flat"))
    with pytest.warns(
        TerrainkitWarning,
        match=r"cliffs between patches: 1 seam, up to 1\.61 m between stairs \(1, 0\) and "
        r"flat \(1, 1\); ",
    ):
        generate(MapConfig(rows=2, cols=2, border=0.0, terrains=terrains))


def test_seam_text_names_patches_and_height():
    names = np.array([["stairs", "wave"]])
    seam = Seam(height=1.614, patches=((0, 0), (0, 1)))
    assert seam_text(seam, names) == "1.61 m between stairs (0, 0) and wave (0, 1)"
    edge = Seam(height=0.5, patches=(None, (0, 0)))
    assert seam_text(edge, names) == "0.50 m between stairs (0, 0) and the border"


def test_cliffs_text_has_one_entry_per_pair():
    names = np.array([["stairs", "wave"], ["stairs", "wave"]])
    cliffs = [
        Seam(height=2.0, patches=((1, 0), (1, 1))),
        Seam(height=1.5, patches=(None, (1, 0))),
        Seam(height=1.0, patches=((0, 0), (0, 1))),
    ]
    assert cliffs_text(cliffs, names) == (
        "3 seams, up to 2.00 m between stairs (1, 0) and wave (1, 1), "
        "1.50 m between stairs (1, 0) and the border"
    )
