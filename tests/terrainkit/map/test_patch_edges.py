import warnings
from dataclasses import replace

import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, TerrainkitWarning, generate
from terrainkit.map.patch_edges import PatchEdge, PatchEdges, cliffs_text, edge_text
from terrainkit.overlays.side_walls import SideWalls

SMALL = MapConfig(
    rows=2,
    cols=3,
    patch_size=(8.0, 4.0),
    border=0.4,
    cell=0.2,
    terrains=(SubTerrain(terrain="flat"),),
)


def edges_of(terrain_map):
    return PatchEdges(terrain_map=terrain_map)


def raised(*blocks, **config):
    """Return the edges of a flat map with raised blocks of samples (x, y, height).

    The border has 2 samples; patches have 40 x 20.
    """
    terrain_map = generate(replace(SMALL, **config))
    heights = np.zeros(terrain_map.grid.shape, dtype=np.float32)
    for x, y, height in blocks:
        heights[x, y] = height
    return edges_of(replace(terrain_map, heights=heights))


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
def test_largest_patch_edge_is_between_these_patches(block, patches):
    found = raised((*block, 0.25)).max()
    assert found == PatchEdge(height=0.25, patches=patches)


def test_largest_patch_edge_ignores_steps_within_patches():
    assert raised((20, 12, 3.0)).max().height == 0.0


def test_map_without_border_has_inner_patch_edges_only():
    one = raised(rows=1, cols=1, border=0.0)
    assert (one.max(), one.cliffs()) == (None, [])
    assert raised((0, slice(None), 1.0), border=0.0).max().height == 0.0
    found = raised((40, 20, 1.0), border=0.0).max()
    assert found == PatchEdge(height=1.0, patches=((0, 1), (1, 1)))


def cliffs(edges):
    return [(edge.height, edge.patches) for edge in edges.cliffs()]


def test_cliff_is_higher_than_half_a_meter_and_than_steps_within_patches():
    # Patch (0, 0) is a block: no step within it.
    block = slice(2, 42), slice(2, 22)
    around = [(None, (0, 0)), ((0, 0), (1, 0)), (None, (0, 0)), ((0, 0), (0, 1))]
    assert cliffs(raised((*block, 0.501))) == [(pytest.approx(0.501), edge) for edge in around]
    assert cliffs(raised((*block, 0.5))) == []
    # A post of 1 m at the edge is a step of 1 m within its patch, and so is a ditch.
    assert cliffs(raised((2, 10, 1.0))) == cliffs(raised((2, 10, -1.0))) == []
    # The steps of both patches add up: 0.5 m in the block and 0.5 m in patch (1, 0).
    for hole, edges in ((0.5, [each for each in around if (1, 0) not in each]), (0.51, around)):
        found = cliffs(raised((*block, 1.0), (30, 10, hole), (60, 10, 0.5)))
        assert found == [(1.0, edge) for edge in edges]


@pytest.mark.parametrize(("sides", "walled"), [("both", True), ("one", False)])
def test_patch_edge_between_walls_is_no_cliff(sides, walled):
    walls = SideWalls(probability=1.0, height=1.0)
    high = SubTerrain(terrain="stairs", overlays=(walls,))
    low = SubTerrain(terrain="flat", overlays=(walls,) if sides == "both" else ())
    config = MapConfig(rows=2, cols=2, border=0.0, terrains=(high, low))
    with warnings.catch_warnings():
        warnings.simplefilter("error" if walled else "ignore")
        assert (cliffs(edges_of(generate(config))) == []) == walled


def test_cliffs_are_sorted_by_height():
    blocks = [(slice(2, 42), slice(2, 22), 1.0), (slice(42, 82), slice(42, 62), 2.0)]
    assert [height for height, _ in cliffs(raised(*blocks))] == [2.0] * 4 + [1.0] * 4


def test_generate_warns_of_cliffs():
    terrains = (SubTerrain(terrain="stairs"), SubTerrain(terrain="flat"))
    with pytest.warns(
        TerrainkitWarning,
        match=r"cliffs between patches: 1 patch edge, up to 1\.61 m between stairs \(1, 0\) and "
        r"flat \(1, 1\); ",
    ):
        generate(MapConfig(rows=2, cols=2, border=0.0, terrains=terrains))


def test_cliffs_text_has_one_entry_per_pair():
    names = np.array([["stairs", "wave"], ["stairs", "wave"]])
    edges = [
        PatchEdge(height=2.004, patches=((1, 0), (1, 1))),
        PatchEdge(height=1.5, patches=(None, (1, 0))),
        PatchEdge(height=1.0, patches=((0, 0), (0, 1))),
    ]
    highest, edge = (
        "2.00 m between stairs (1, 0) and wave (1, 1)",
        "1.50 m between stairs (1, 0) and the border",
    )
    assert [edge_text(edge, names) for edge in edges[:2]] == [highest, edge]
    assert cliffs_text(edges, names) == f"3 patch edges, up to {highest}, {edge}"
    assert cliffs_text(edges[1:2], names) == f"1 patch edge, up to {edge}"
