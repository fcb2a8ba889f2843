import dataclasses

import numpy as np
import pytest

import terrainkit as tk
from terrainkit.geometry.solids import make_boxes
from terrainkit.map.validate import validate
from tests.tables import read_table
from tests.terrainkit.maps import contents

FLAT = tk.MapConfig(
    rows=2,
    cols=3,
    patch_size=(4.0, 3.0),
    border=1.0,
    spawns_per_patch=2,
    terrains=(tk.SubTerrain(terrain="flat"),),
)


@pytest.fixture(scope="module")
def flat():
    return tk.generate(FLAT)


def messages(terrain_map):
    return [(issue.check, issue.message) for issue in validate(terrain_map)]


def with_bump(terrain_map, row, col, height):
    """Return heights with a square of 1 m around the center of a patch at `height`."""
    heights = terrain_map.heights.copy()
    i, j = terrain_map.config.patch_start(row, col)
    heights[i + 15 : i + 25, j + 10 : j + 20] = height
    return heights


def test_edited_map_is_valid_and_survives_a_file(flat, tmp_path):
    edited = flat.edited(heights=with_bump(flat, 1, 2, 0.4))
    assert edited.config == dataclasses.replace(flat.config, mode="custom")
    assert messages(edited) == []
    assert flat.config.mode == "curriculum"
    loaded = tk.TerrainMap.load(edited.save(tmp_path / "edited.npz"))
    assert contents(loaded) == contents(edited)
    for again in (edited.config, flat.edited().config):
        with pytest.raises(tk.TerrainkitError, match=r"^mode custom: the map was imported or"):
            tk.generate(again)
        with pytest.raises(tk.TerrainkitError, match=r"^mode custom"):
            tk.make_patch(again, 0, 0)


def test_edited_moves_only_invalid_spawns(flat):
    edited = flat.edited(heights=with_bump(flat, 1, 2, 0.4))
    # The origin (6, 7.5) is on the bump of 1 m, whose disk of 0.5 m touches the edge.
    assert np.hypot(*(edited.env_origins[1, 2, :2] - [6.0, 7.5])) > 0.9
    same = np.ones((2, 3), bool)
    same[1, 2] = False
    np.testing.assert_array_equal(edited.spawns[same], flat.spawns[same])


def test_edited_lifts_spawns_and_goals():
    crawl = tk.SubTerrain(terrain="crawl")
    old = tk.generate(tk.MapConfig(rows=1, cols=1, border=1.0, terrains=(crawl,)))
    edited = old.edited(heights=old.heights + 2.0)
    np.testing.assert_allclose(edited.spawns - old.spawns, [[[[0, 0, 2, 0]]]], atol=1e-6)
    lifted = np.broadcast_to([0, 0, 2, 0], old.goals.shape)
    np.testing.assert_allclose(edited.goals - old.goals, lifted, atol=1e-6)


def test_edited_assigns_solids_to_the_patch_of_their_center(flat):
    # Patches of 4 m x 3 m; solids beyond them belong to the nearest.
    centers = [[5.0, 7.5, 2.0], [3.9, 3.1, 2.0], [-0.5, -0.5, 2.0], [8.4, 9.4, 2.0]]
    edited = flat.edited(solids=make_boxes(centers, [0.5, 0.5, 0.1]))
    assert edited.solids.patch.tolist() == [[1, 2], [0, 1], [0, 0], [1, 2]]
    assert messages(edited) == []
    # A board 0.3 m above the origin (2, 1.5) of patch (0, 0), which belongs to (0, 1).
    board = flat.edited(solids=make_boxes([2.0, 3.05, 0.35], [0.4, 3.0, 0.1]))
    assert abs(board.env_origins[0, 0] - [2.0, 1.5, 0.0]).max() > 0.5
    assert messages(board) == []


def test_edited_without_flat_disc_is_an_error(flat):
    heights = flat.heights.copy()
    i, j = flat.config.patch_start(1, 1)
    heights[i : i + 40 : 4, j : j + 30] = 0.2
    with pytest.raises(
        tk.TerrainkitError, match=r"^patch \(1, 1\): no disk of radius 0\.5 m is flat"
    ):
        flat.edited(heights=heights)


@pytest.mark.parametrize("heights", [np.zeros((3, 4)), np.full((100, 110), np.nan)])
def test_edited_rejects_invalid_heights(flat, heights):
    with pytest.raises(tk.TerrainkitError, match=r"expected \(100, 110\) with values"):
        flat.edited(heights=heights)


def test_validate_finds_solid_beyond_custom_map(flat):
    # The map ends at y = 10.
    boxes = make_boxes([[1.0, 9.9, 2.0], [1.0, 9.7509, 2.0]], [0.5, 0.5, 0.1])
    issues = [("solids", "solid 0 extends 0.150 m beyond the map")]
    assert messages(flat.edited(solids=boxes)) == issues


@pytest.mark.parametrize(("goal", "message"), read_table(__file__, "validate_finds_invalid_goal"))
def test_validate_finds_invalid_goal_of_custom_map(flat, goal, message):
    goals = np.full((2, 3, 4, 4), np.nan, dtype=np.float32)
    goals[0, 0, :3] = [(1.0, 1.0, 0.0, 0.0), goal, (3.0, 2.0, 0.0, 0.0)]
    block = make_boxes((3.5, 0.5, 0.5), (0.6, 0.6, 1.0))
    terrain_map = dataclasses.replace(flat.edited(solids=block), goals=goals)
    expected = [f"patch (0, 0): goal 1 {message}"] if message else []
    assert [each.message for each in validate(terrain_map) if each.check == "goals"] == expected
