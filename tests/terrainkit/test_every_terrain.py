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
from terrainkit.geometry.measured_difficulty import measured_difficulty
from terrainkit.map.patch_edges import PatchEdges
from terrainkit.map.validate import validate
from terrainkit.overlays.noise import Noise
from terrainkit.terrain import Terrain, registry
from terrainkit.terrain.parameter import MAX_VALUE, parameters_of
from tests.limits import LIMITS as ROBOT
from tests.tables import read_table

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


LIMITS = read_table(__file__, "limits")
"""Terrains with a parameter of 8 m x 8 m that just fits and one that does not, and its error."""


@pytest.mark.parametrize(
    ("terrain", "limits", "problem"),
    LIMITS,
    ids=[f"{name} {[*given]}" for name, given, _ in LIMITS],
)
def test_every_terrain_rejects_what_does_not_fit(terrain, limits, problem):
    for end in (0, 1):
        values = {
            name: pair[end] if isinstance(pair, list) else pair for name, pair in limits.items()
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


GOALS = read_table(__file__, "goals")
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
        is_list = isinstance(declared.easy, tuple)
        try:
            choice = SubTerrain(
                terrain=terrain,
                parameters={parameter: [value] if is_list else type(declared.easy)(value)},
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
