"""Tests of all terrains.

Their parameters and numbers of their patches, with default parameters and with others, are in
terrain_values.json. `make records` writes them anew: maps of equal configs differ between versions
then.
"""

import contextlib
import json
import warnings
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terrainkit import MapConfig, SubTerrain, TerrainkitError, generate
from terrainkit.errors import ConfigError
from terrainkit.feasibility import MAX_DEMAND, assess_map
from terrainkit.geometry.grid import Grid
from terrainkit.map.measured_difficulty import measured_difficulty
from terrainkit.map.patch_edges import PatchEdges
from terrainkit.map.validate import validate
from terrainkit.overlays.noise import Noise
from terrainkit.terrain import Terrain, registry
from terrainkit.terrain.parameter import MAX_VALUE, parameters_of
from tests.limits import LIMITS as ROBOT

VALUES = Path(__file__).with_name("terrain_values.json")
VARIANTS = [(name, {}) for name in registry.terrain_names()] + [
    (name, {"inverted": True})
    for name in registry.terrain_names()
    if "inverted" in parameters_of(registry.get_terrain(name))
]
every_terrain = pytest.mark.parametrize(
    ("terrain", "given_parameters"),
    VARIANTS,
    ids=[f"{name}_inverted" if inverted else name for name, inverted in VARIANTS],
)
GRID = Grid(shape=(80, 80), cell=0.1)
DEFAULT_GRIDS = [
    pytest.param(GRID, id="8x8"),
    pytest.param(Grid(shape=(160, 80), cell=0.05), id="8x4 fine"),
]
GRIDS = [
    *DEFAULT_GRIDS,
    pytest.param(Grid(shape=(73, 51), cell=0.1), id="7.3x5.1"),
    pytest.param(Grid(shape=(40, 40), cell=0.2), id="coarse"),
]
every_grid = pytest.mark.parametrize("grid", GRIDS)
CENTERED_BLOCKS = [
    (name, field)
    for name in registry.terrain_names()
    for field, known in parameters_of(registry.get_terrain(name)).items()
    if known.snap == "centered"
]
every_default_grid = pytest.mark.parametrize("grid", DEFAULT_GRIDS)
OUTLINE = np.array([(x, y) for x in np.linspace(-1, 1, 21) for y in (-1, 1)])
OUTLINE = np.concatenate([OUTLINE, OUTLINE[:, ::-1]])
"""Points on the outline of a square with sides of 2."""

DIFFICULTIES = (0.0, 0.25, 0.5, 0.75, 1.0)
# Some grids are too coarse for some parameters; generate warns, which is not tested here.
coarse = pytest.mark.filterwarnings("ignore:cells of:terrainkit.TerrainkitWarning")


def at_every_difficulty(terrain, parameters, grid, seed=0):
    """Return the heights at each difficulty, all from the same draws."""
    choice = SubTerrain(terrain=terrain, parameters=parameters)
    return [choice.at(d).build(grid, np.random.default_rng(seed)) for d in DIFFICULTIES]


def map_of(terrain, parameters, grid, **rest):
    """Return a map of one terrain: rows of difficulty 0, 0.5 and 1, and one draw of each."""
    choice = SubTerrain(terrain=terrain, parameters=parameters)
    config = {"rows": 3, "cols": 1, "patch_size": grid.size, "cell": grid.cell, "border": 1.0}
    return generate(MapConfig(**config | {"terrains": (choice,)} | rest))


def assert_spawns_are_level(terrain_map, radius):
    """Look at the ground itself all over the disk around each origin, which is in its patch."""
    config = terrain_map.config
    origins = terrain_map.env_origins.astype(float)
    for row, col in np.ndindex(config.rows, config.cols):
        grid = config.patch_grid(row, col)
        assert (origins[row, col, :2] >= np.array(grid.lower) + radius).all()
        assert (origins[row, col, :2] <= np.array(grid.upper) - radius).all()
    x, y, z = origins.reshape(-1, 3, 1, 1).transpose(1, 0, 2, 3)
    r = np.linspace(0.0, radius, 21)[:, None]
    angle = np.linspace(0.0, 2 * np.pi, 64, endpoint=False)
    ground = terrain_map.height(np.stack([x + r * np.cos(angle), y + r * np.sin(angle)], axis=-1))
    assert np.abs(ground[:, :1] - z).max() < 1e-3
    assert np.abs(ground - z).max() <= config.spawn_tolerance + 1e-5
    assert np.ptp(ground, axis=(1, 2)).max() <= config.spawn_tolerance + 1e-5


LIMITS = [
    ("beams", {"gap": (1.29, 1.3)}, "got gaps 1.3 m long with a spacing of 1.3 m"),
    ("boxes", {"min_side": (1.8, 1.81)}, "got min_side 1.81 m and max_side 1.8 m"),
    ("boxes", {"min_side": (1.0, 3.0), "max_side": 4.0}, "a box that fits beside a platform of 2"),
    ("boxes", {"height": (1.0, 9.0), "tilt": 0.1}, "a box that fits beside a platform of 2"),
    ("building", {"storeys": (4, 5)}, "got 5 storeys 2.4 m high"),
    ("building", {"door_height": (2.19, 2.2)}, "expected .* sill < door_height < 2.2 m"),
    ("building", {"door": (1.3, 1.32)}, "expected .* door < 0.85 room_size - 0.22 m"),
    ("building", {"corridor": (5.3, 5.6)}, "stairs and a corridor that fit in a patch of 8 m"),
    ("continuous_ramps", {"length": (5.0, 5.01)}, "got elements of 5.01 m x 1.2 m between strips"),
    ("continuous_ramps", {"width": (8.0, 8.01)}, "got elements of 0.6 m x 8.01 m between strips"),
    ("crawl", {"min_depth": (0.6, 0.61)}, "expected min_depth <= max_depth, and a bar"),
    ("crawl", {"start": (6.4, 6.5)}, "expected min_depth <= max_depth, and a bar that fits"),
    ("crawl", {"spacing": (0.02, 0.019), "min_depth": 0.01, "max_depth": 0.01}, "least 0.03 m"),
    ("floating_islands", {"walkway": (0.9, 0.91)}, "expected walkway <= radius"),
    ("floating_islands", {"radius": (1.0, 1.5)}, "an island that fits"),
    ("gap_track", {"length": (1.5, 1.6)}, "got gaps 1.6 m long"),
    ("gutter", {"roll": (1.5707, 1.5708)}, "expected a roll below 1.5708 rad"),
    ("gutter", {"bottom": (2.39, 2.4)}, "got roll"),
    ("gutter", {"width": (8.0, 8.1)}, "got roll"),
    ("gutter", {"start": 4.0, "end": (3.9, 4.0)}, "got roll"),
    ("hurdles", {"max_thickness": (1.1, 1.2)}, "got hurdles 1.2 m long"),
    ("hurdles", {"top": "round", "height": (0.21, 0.2), "min_thickness": 0.4}, "got a height of"),
    ("k_rails", {"height": (0.848, 0.849)}, "got height 0.849 m; expected less than 0.7 of"),
    ("k_rails", {"panel": (2.5, 2.51)}, "got panel .* expected 2 to 10000 panels"),
    ("k_rails", {"panel": (0.07, 0.06), "height": 0.01}, "got panel .* 2 to 10000 panels"),
    ("ladder", {"angle": (0.5, 0.499)}, "expected an angle of 0.5 rad to 1.57 rad"),
    ("ladder", {"angle": (1.5707, 1.5708)}, "expected an angle of 0.5 rad to 1.57 rad"),
    ("ladder", {"rung_spacing": (1.5, 1.51)}, "got angle .*, rung_spacing 1.51 m"),
    ("ladder", {"rung_spacing": (0.000151, 0.000149)}, "got angle"),
    ("ladder", {"distance": (2.45, 2.46)}, "got angle .* distance 2.46 m"),
    ("ladder", {"landing": (3.9, 4.0)}, "two landings of 4 m leave no deck in a patch 8 m long"),
    ("maze", {"corridor": (3.7, 3.71)}, "expected at least 2 x 2 cells that fit in a patch of 8"),
    ("obstacles", {"min_width": (2.0, 2.1)}, "got min_width 2.1 m and max_width 2 m"),
    ("obstacles", {"max_width": (8.0, 8.1)}, "max_width 8.1 m; expected .* the patch, 8 m x 8 m"),
    ("open_stairs", {"tread": (4.0, 4.01)}, "two strips of 2 m leave no tread of 4.01 m"),
    ("pallets", {"platform": (4.0, 6.0)}, "got a platform of 6 m"),
    ("poles", {"min_width": (0.75, 0.76)}, "got widths .* expected min <= max, and a pole"),
    ("poles", {"min_height": (2.0, 2.1)}, "got widths .* expected min <= max, and a pole"),
    ("poles", {"gap": (1.0, 9.0)}, "got widths .* expected min <= max, and a pole"),
    (
        "pyramid_stairs",
        {"step_width": 0.3, "platform": (7.4, 7.6)},
        "no step of 0.3 m fits between",
    ),
    ("rails", {"width": (0.99, 1.0)}, "got width 1 m; expected less than .* 1 m with 2"),
    ("random_grid", {"block": (7.8, 7.9)}, "no block of 7.9 m fits in a rim"),
    ("random_stairs", {"min_step_height": (0.08, 0.09)}, "got min_step_height 0.09 m and step_h"),
    ("road", {"bump_length": (1.89, 1.9)}, "got speed bumps 2 m long with a spacing of 2 m"),
    ("road", {"min_radius": (0.375, 0.376)}, "expected min_radius <= max_radius"),
    ("rocks", {"min_radius": (0.6, 0.7)}, "expected min <= max, and a rock that fits"),
    ("rocks", {"min_radius": (1.0, 2.0), "max_radius": 2.0}, "a rock that fits"),
    ("rooms", {"door": (2.29, 2.3)}, "expected door < side, and a room that fits"),
    ("rooms", {"side": (7.6, 7.7)}, "expected door < side, and a room that fits"),
    ("side_ramps", {"gap": (1.5, 1.6)}, "got gaps 1.6 m long"),
    ("side_ramps", {"roll": (0.876, 0.8761)}, "got roll .* above the floor of the pit"),
    ("side_ramps", {"roll": (0.876, 1.6)}, "got roll 1.6 rad and width 1 m"),
    ("side_ramps", {"depth": (0.089, 0.088)}, "above the floor of the pit, 0.088 m deep"),
    ("sidewalk", {"end": (2.6, 2.8)}, "which need 2.8 m; expected at most 2.* m between start"),
    (
        "sidewalk",
        {"tree_grate": (1.8, 1.81), "end": 0.5},
        "got spacing 2 m; expected at least 2.01 m",
    ),
    ("sidewalk", {"slot": (0.14, 0.145)}, "got slots of 0.145 m in a grating 0.3 m long"),
    ("sidewalk", {"spacing": (8.0, 8.01)}, "and at most the width of the patch, 8 m"),
    ("slit", {"offset": (3.77, 3.78)}, "got an opening of 0.455 m with an offset of 3.78 m"),
    ("slope", {"landing": (3.9, 4.0)}, "two landings of 4 m leave no slope in a patch 8 m long"),
    ("spiral_stairs", {"radius": (0.31, 0.3)}, "expected column < radius, a tread of at most a"),
    ("spiral_stairs", {"radius": (3.0, 3.01)}, "a spiral that fits behind a start of 2 m"),
    ("spiral_stairs", {"tread": (1.41, 1.42)}, "a tread of at most a quarter turn"),
    ("spiral_stairs", {"number": (200, 201)}, "at most 200 treads"),
    ("staircase", {"width": (7.86, 7.87)}, "expected a straight staircase .* that fits in a patch"),
    ("staircase", {"riser_difference": (0.119, 0.12)}, "with riser_difference < riser"),
    ("stairs", {"landing": (3.8, 3.9)}, "two landings of 3.9 m leave no step of 0.31 m"),
    ("stairs_turning", {"landing": (2.8, 2.9)}, "expected flights that fit in a patch of 8 m x 8"),
    ("stakes", {"diameter": (0.3, 0.001), "gap": 0.001}, "got .* from one to the next; expected"),
    ("star", {"width": (0.707, 0.708)}, "got width 0.708 m; expected at most 0.707 m"),
    ("star", {"rim": (2.9, 3.0)}, "got a rim of 3 m and a platform of 2 m; expected a pit"),
    ("stepfield", {"post": (0.5, 0.6)}, "expected a field of 10 x 10 posts that fits"),
    ("stepping_beams", {"min_length": (1.6, 1.7)}, "min_length: got 1.7 m; expected at most max_"),
    ("stepping_beams", {"start": (6.0, 6.5)}, "got beams 0.5 m long"),
    ("stone_rows", {"stone": (3.8, 3.81)}, "expected two rows that fit in a pit of 4 m x 7.8 m"),
    ("stone_rows", {"stone": (3.0, 3.01), "gap": 0.5}, "expected two rows that fit"),
    ("stone_rows", {"row_gap": (6.2, 6.21)}, "expected two rows that fit"),
    ("stones_everywhere", {"stone": (0.96, 0.001), "gap": 0.001}, "got 0.002 m from one to the ne"),
    ("street", {"passage": (2.0, 3.0)}, "got passage 3 m, .* and at most 2.* m between curb and"),
    ("street", {"door": (1.19, 1.2)}, "expected door < step_width < spacing"),
    ("tilted_grid", {"block": (7.8, 7.9)}, "no block of 7.9 m fits in a rim"),
    ("tunnel", {"width": (7.9, 8.0)}, "got width 8 m; expected less than the width of the patch"),
    ("tunnel", {"depth": (2.9, 3.0)}, "got tunnels 3 m long"),
    ("wave", {"number": (20, 21)}, "21 waves need .* 84 along both axes; the patch has 80 x 80"),
]
"""Terrains with a parameter of 8 m x 8 m that just fits and one that does not, and its error."""


@pytest.mark.parametrize(
    ("terrain", "limits", "problem"),
    LIMITS,
    ids=[f"{name} {[*given]}" for name, given, _ in LIMITS],
)
def test_every_terrain_rejects_what_does_not_fit(terrain, limits, problem):
    for end in (0, 1):
        values = {
            name: pair[end] if isinstance(pair, tuple) else pair for name, pair in limits.items()
        }
        built, rng = registry.get_terrain(terrain).at(0.0, values), np.random.default_rng(0)
        rejected = pytest.raises(ConfigError, match=f"^{terrain}.*{problem}")
        with rejected if end else contextlib.nullcontext():
            built.solids(GRID, built.build(GRID, rng), rng)


@coarse
@every_default_grid
@every_terrain
def test_every_terrain_map_is_valid(terrain, given_parameters, grid):
    terrain_map = map_of(terrain, given_parameters, grid)
    assert terrain_map.difficulty.ravel().tolist() == [0.0, 0.5, 1.0]
    # The mesh, the spawn origins, and a second build of each patch. Some parameters do not fit.
    assert [issue for issue in validate(terrain_map) if issue.check != "realized"] == []
    cliffs = PatchEdges(terrain_map=terrain_map).cliffs()
    assert [edge for edge in cliffs if None not in edge.patches] == []


@coarse
@every_default_grid
@pytest.mark.parametrize(("terrain", "block"), CENTERED_BLOCKS)
def test_every_terrain_platform_is_flat_as_recorded(terrain, block, grid):
    declared = parameters_of(registry.get_terrain(terrain))
    # By default, steps below 0.075 m are ramps, which start half a cell earlier.
    threshold = 0.75 if declared[block].sloped_edge else 0.05
    for parameters in ({}, {"inverted": True}) if "inverted" in declared else ({},):
        terrain_map = map_of(terrain, parameters, grid, slope_threshold=threshold, seed=1)
        for row in range(3):
            patch = terrain_map.patch(row, 0)
            side = np.broadcast_to(patch.parameters.realized[block], 2)
            inside, outside = (
                terrain_map.height(patch.grid.center + outline * (side / 2 + margin))
                for margin, outline in ((-1e-3, OUTLINE), (1e-2, OUTLINE))
            )
            assert np.ptp(inside) < 1e-5
            if row == 2 and declared[block].sloped_edge:
                assert np.ptp([*outside, inside[0]]) > 1e-4


@coarse
@pytest.mark.parametrize(
    ("grid", "rest"),
    [pytest.param(*each.values, {}, id=each.id) for each in GRIDS]
    + [
        pytest.param(GRID, {"slope_threshold": None}, id="no walls"),
        pytest.param(GRID, {"spawn_radius": 0.7, "spawn_tolerance": 0.0}, id="wide and exact"),
        pytest.param(GRID, {"centered": True, "border": 0.0}, id="centered"),
    ],
)
@every_terrain
def test_every_terrain_spawn_is_level_on_any_map(terrain, given_parameters, grid, rest):
    draws = {"cols": 4 if rest else 2, "seed": grid.shape[0] * grid.shape[1]}
    terrain_map = map_of(terrain, given_parameters, grid, **draws, **rest)
    assert_spawns_are_level(terrain_map, terrain_map.config.spawn_radius)


def other_parameters(terrain):
    """Return other values than the defaults for all parameters but texts and tables."""
    found = {}
    for name, parameter in parameters_of(registry.get_terrain(terrain)).items():
        if parameter.choices:
            found[name] = parameter.choices[-1]
        elif isinstance(parameter.easy, float | int):
            ends = [other_value(parameter.easy), other_value(parameter.hard)]
            found[name] = ends if parameter.allow_range else ends[0]
    # Hurdles have to be higher than half of the width of their round tops.
    return found | ({"height": 0.4} if terrain == "hurdles" else {})


def other_value(value):
    if isinstance(value, bool):
        return not value
    return value + 1 if isinstance(value, int) else 0.93 * value


RECORDED = {f"{name} {json.dumps(given)}": (name, given, (81, 60)) for name, given in VARIANTS} | {
    f"{name} other": (name, other_parameters(name), (75, 91)) for name in registry.terrain_names()
}
"""Terrain, parameters and shape of each record."""


@coarse
@pytest.mark.parametrize("key", RECORDED)
def test_every_terrain_keeps_its_values(key):
    recorded = json.loads(VALUES.read_text()).get(key)
    assert recorded, "`make records` writes the values of a new terrain"
    for found, expected in zip(values_of(*RECORDED[key]), recorded, strict=True):
        assert found.keys() == expected.keys()
        for name, value in expected.items():
            is_text = isinstance(value, str)
            assert found[name] == (value if is_text else pytest.approx(value, 1e-6, 1e-3)), name


def values_of(terrain, parameters, shape):
    """Return parameters and sums of arrays of a patch of difficulty 0 and of one of difficulty 1.

    Each element has another weight in a sum, so that no two can be swapped.
    """
    terrain_map = map_of(terrain, parameters, Grid(shape=shape, cell=0.1), rows=2, seed=5)
    patches = [terrain_map.patch(row, 0) for row in range(2)]
    return [
        {name: str(value) for name, value in patch.parameters.requested.items()}
        | {f"{name}, realized": value for name, value in patch.parameters.realized.items()}
        | {
            name: weighted(values)
            for name, values in (
                ("heights", patch.heights),
                ("friction", patch.friction),
                ("goals", patch.goals),
                ("spawns", patch.spawns),
                ("boxes", patch.solids.boxes),
                ("cylinders", patch.solids.cylinders),
                ("hulls", patch.solids.hull_vertices),
            )
        }
        for patch in patches
    ]


def weighted(values):
    weights = 1 + np.cos(np.arange(values.size)).reshape(values.shape)
    return round(float((values * weights).sum()), 4)


GOALS = {
    "continuous_ramps": [7.4],
    "course": [4.0, 7.0],
    "crossing_ramps": [7.4],
    "gap_track": [3.9, 5.8, 7.7],
    "gutter": [7.5],
    "hurdles": [3.7, 5.4, 7.1],
    "k_rails": [7.4],
    "ladder": [4.0, 6.5],
    "open_stairs": [4.0, 7.0],
    "road": [4.0, 6.0, 7.95],
    "side_ramps": [3.0, 4.6, 6.2, 7.6],
    "sidewalk": [4.5, 7.5],
    "staircase": [4.309, 7.309],
    "slit": [3.5, 5.0, 6.5, 7.95],
    "stepfield": [2.95, 3.95, 4.95, 5.95, 7.5],
    "stepping_beams": [7.7],
    "stone_rows": [7.0],
    "tunnel": [5.0, 7.95],
}
"""x of the goals on a lane of 8 m x 8 m at difficulty 1 [m]."""


@coarse
@pytest.mark.parametrize("overlays", [(), (Noise(),)], ids=["bare", "noise"])
@every_default_grid
@every_terrain
def test_every_terrain_goals_are_on_free_ground(terrain, given_parameters, grid, overlays):
    choice = SubTerrain(terrain=terrain, parameters=given_parameters, overlays=overlays)
    terrain_map = map_of(terrain, {}, grid, rows=5, terrains=(choice,))
    goals = terrain_map.goals.reshape(-1, 4)
    x, y, z = goals[~np.isnan(goals[:, 0]), :3].astype(float).T
    above = np.column_stack([x, y, z + 0.2])
    assert not (terrain_map.scan(above, "up") < z + 1.0).any()
    assert terrain_map.scan(above, "down") == pytest.approx(z, abs=1e-4)
    if terrain in GOALS and grid == GRID and not overlays:
        x, _, _, heading = terrain_map.patch(4, 0).goals.T
        assert x - 32.0 == pytest.approx(GOALS[terrain])
        assert not heading.any()


NUMBER_VARIES = {"maze", "poles", "stakes", "stone_rows", "stones_everywhere"}
"""Terrains whose number of random objects depends on the difficulty."""


@pytest.mark.parametrize("terrain", sorted({*registry.terrain_names()} - NUMBER_VARIES))
def test_every_terrain_takes_the_same_random_numbers_at_every_difficulty(terrain):
    states = []
    for difficulty in DIFFICULTIES:
        built, rng = registry.get_terrain(terrain).at(difficulty), np.random.default_rng(0)
        built.solids(GRID, built.build(GRID, rng), rng)
        states.append(rng.bit_generator.state)
    assert all(state == states[0] for state in states)


@every_terrain
def test_every_terrain_depends_on_the_seed(terrain, given_parameters):
    rng = np.random.default_rng(1)
    one = SubTerrain(terrain=terrain, parameters=given_parameters).at(1.0)
    heights = one.build(GRID, rng)
    draws = rng.random() != np.random.default_rng(1).random()
    other = one.build(GRID, np.random.default_rng(2))
    assert (heights != other).any() == draws == type(one).has_random_heights


RANDOM_GROUND = [
    name
    for name in registry.terrain_names()
    if registry.get_terrain(name).has_random_heights
    and registry.get_terrain(name).solids is Terrain.solids
]


@coarse
@pytest.mark.parametrize("terrain", RANDOM_GROUND)
def test_every_terrain_with_random_ground_demands_no_less_on_a_harder_row(terrain):
    terrain_map = map_of(terrain, {}, GRID, rows=6, cols=2)
    demand = [each.demand for each in assess_map(terrain_map, ROBOT)]
    change = np.diff(np.minimum(np.reshape(demand, (6, 2)), MAX_DEMAND), axis=0)
    assert change.min() >= -0.05


@every_terrain
def test_every_terrain_depends_on_shape_cell_and_generator_only(terrain, given_parameters):
    """Check that an earlier build, another place and global state do not change the heights."""
    here, there = (
        Grid(shape=(73, 51), cell=0.1, lower=lower) for lower in ((0.0, 0.0), (72.0, -13.0))
    )
    np.random.seed(1)  # noqa: NPY002
    first = at_every_difficulty(terrain, given_parameters, here, seed=3)
    after = np.random.random()  # noqa: NPY002
    assert after == np.random.RandomState(1).random()
    second = at_every_difficulty(terrain, given_parameters, there, seed=3)
    assert [heights.tobytes() for heights in first] == [heights.tobytes() for heights in second]


@every_grid
@every_terrain
def test_every_terrain_heights_are_finite_and_no_easier_when_harder(
    terrain, given_parameters, grid
):
    x, y = registry.get_terrain(terrain).at(0.0).spawn(grid)
    start = int(x / grid.cell), int(y / grid.cell)
    patches = at_every_difficulty(terrain, given_parameters, grid)
    for heights in patches:
        assert heights.dtype == np.float32
        assert heights.shape == grid.shape
        assert np.isfinite(heights).all()
    hard = [measured_difficulty(heights, grid.cell, heights[start]) for heights in patches]
    assert np.diff(hard).min() >= -1e-9
    ramps = [p.easy != p.hard for p in parameters_of(registry.get_terrain(terrain)).values()]
    if registry.get_terrain(terrain).solids is Terrain.solids:  # the measure is of the ground
        assert (hard[-1] > hard[0]) == any(ramps)


@every_terrain
def test_every_terrain_is_realized_within_a_cell(terrain, given_parameters):
    grids = [((80, 80), 0.1), ((73, 51), 0.1), ((160, 120), 0.05), ((41, 40), 0.2)]
    for (shape, cell), difficulty in product(grids, DIFFICULTIES):
        grid = Grid(shape=shape, cell=cell)
        built = registry.get_terrain(terrain).at(difficulty, given_parameters)
        requested, realized = built.requested(), built.realized(grid)
        assert list(realized) == list(requested)
        for name, parameter in parameters_of(type(built)).items():
            if isinstance(requested[name], str):
                assert realized[name] == requested[name]
            elif parameter.snap == "none":
                # Noise keeps to a grid of nodes, and no sample need be on the crest of a wave.
                assert np.array(realized[name]) == pytest.approx(requested[name], rel=0.05)
            else:
                off = np.abs(np.array(realized[name]) - requested[name])
                assert off.max() <= (1 + parameter.sloped_edge) * cell + 1e-9


@pytest.mark.filterwarnings("ignore:.*example.npy")  # of sizes that no ground has
@pytest.mark.parametrize("terrain", registry.terrain_names())
def test_every_terrain_builds_or_rejects_extreme_values(terrain):
    every_parameter = parameters_of(registry.get_terrain(terrain)).items()
    for (parameter, declared), value in product(every_parameter, (5e-324, MAX_VALUE, 1e308)):
        try:
            choice = SubTerrain(
                terrain=terrain,
                parameters={parameter: [value] if declared.table else type(declared.easy)(value)},
            )
            built = choice.at(1.0)
            heights = built.build(GRID, np.random.default_rng(0))
        except TerrainkitError:
            continue
        assert np.isfinite(heights).all(), (parameter, value)
        assert set(built.realized(GRID)) == set(built.requested()), (parameter, value)


@coarse
@settings(deadline=None, derandomize=True, max_examples=200)
@given(
    variant=st.sampled_from(VARIANTS),
    shape=st.tuples(st.integers(1, 90), st.integers(1, 90)),
    cell=st.sampled_from([0.05, 0.1, 0.2, 0.5]),
    difficulty=st.floats(0, 1),
    radius=st.sampled_from([0.1, 0.3, 0.5]),
)
def test_every_terrain_builds_or_rejects_any_patch(variant, shape, cell, difficulty, radius):
    terrain, parameters = variant
    grid = Grid(shape=shape, cell=cell)
    config = MapConfig(
        mode="selected",
        rows=1,
        cols=1,
        patch_size=grid.size,
        cell=cell,
        border=0.0,
        selected_difficulty=difficulty,
        spawn_radius=radius,
        terrains=(SubTerrain(terrain=terrain, parameters=parameters),),
    )
    try:
        terrain_map = generate(config)
    except ConfigError:
        return
    assert np.isfinite(terrain_map.heights).all()
    assert_spawns_are_level(terrain_map, radius)


if __name__ == "__main__":
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        values = {key: values_of(*terrain) for key, terrain in RECORDED.items()}
    VALUES.write_text(json.dumps(values, indent=0) + "\n")
