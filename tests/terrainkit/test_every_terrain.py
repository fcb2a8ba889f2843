"""Tests of all terrains.

Their parameters and numbers of their patches are in terrain_values.json. Write them anew with
`python -m tests.terrainkit.test_every_terrain`: maps of equal configs differ between versions then.
"""

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
from terrainkit.geometry.grid import Grid
from terrainkit.map.measured_difficulty import measured_difficulty
from terrainkit.map.seams import Seams
from terrainkit.map.validate import validate
from terrainkit.terrain import Terrain, registry
from terrainkit.terrain.parameter import MAX_VALUE, parameters_of

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
DEFAULT_GRIDS = [
    pytest.param(Grid(shape=(80, 80), cell=0.1), id="8x8"),
    pytest.param(Grid(shape=(160, 80), cell=0.05), id="8x4 fine"),
]
every_grid = pytest.mark.parametrize(
    "grid",
    [
        *DEFAULT_GRIDS,
        pytest.param(Grid(shape=(73, 51), cell=0.1), id="7.3x5.1"),
        pytest.param(Grid(shape=(40, 40), cell=0.2), id="coarse"),
    ],
)
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


def map_of_draws(terrain, parameters, grid, cols, **rest):
    """Return a map with `cols` draws; one of a terrain that draws nothing, as all are the same.

    Maps of different grids have different draws.
    """
    built, rng = (
        SubTerrain(terrain=terrain, parameters=parameters).at(1.0),
        np.random.default_rng(0),
    )
    initial = rng.bit_generator.state
    built.solids(grid, built.build(grid, rng), rng)
    draws = rng.bit_generator.state != initial
    seed = grid.shape[0] * grid.shape[1]
    return map_of(terrain, parameters, grid, cols=cols if draws else 1, seed=seed, **rest)


def assert_spawns_are_level(terrain_map, radius):
    """Look at the ground itself all over the disk around each origin."""
    x, y, z = terrain_map.env_origins.astype(float).reshape(-1, 3, 1, 1).transpose(1, 0, 2, 3)
    r = np.linspace(0.0, radius, 21)[:, None]
    angle = np.linspace(0.0, 2 * np.pi, 64, endpoint=False)
    disk = np.stack([x + r * np.cos(angle), y + r * np.sin(angle)], axis=-1)
    ground = terrain_map.height(disk)
    assert np.abs(ground[:, :1] - z).max() < 1e-3
    assert np.abs(ground - z).max() <= terrain_map.config.spawn_tolerance + 1e-5
    assert np.ptp(ground, axis=(1, 2)).max() <= terrain_map.config.spawn_tolerance + 1e-5


def assert_spawns_are_inside(terrain_map, radius):
    config = terrain_map.config
    for row, col in np.ndindex(config.rows, config.cols):
        x, y, _ = terrain_map.env_origins[row, col]
        grid = config.patch_grid(row, col)
        assert grid.lower[0] + radius <= x <= grid.upper[0] - radius
        assert grid.lower[1] + radius <= y <= grid.upper[1] - radius


@pytest.mark.parametrize(("terrain", "block"), CENTERED_BLOCKS)
def test_every_terrain_rejects_block_as_wide_as_patch(terrain, block):
    for size in (4.0, 7.9):
        grid = Grid(shape=(round(size / 0.1),) * 2, cell=0.1)
        choice = SubTerrain(terrain=terrain, parameters={block: size})
        with pytest.raises(ConfigError, match=f"{block} {size:g} m fills the whole patch of"):
            choice.at(0.5).build(grid, np.random.default_rng(0))


@coarse
@every_grid
@every_terrain
def test_every_terrain_spawn_is_level(terrain, given_parameters, grid):
    terrain_map = map_of_draws(terrain, given_parameters, grid, cols=2)
    assert_spawns_are_level(terrain_map, 0.5)
    assert_spawns_are_inside(terrain_map, 0.5)


@coarse
@every_default_grid
@every_terrain
def test_every_terrain_map_is_valid(terrain, given_parameters, grid):
    terrain_map = map_of(terrain, given_parameters, grid)
    assert terrain_map.difficulty.ravel().tolist() == [0.0, 0.5, 1.0]
    # The mesh, the spawn origins, and a second build of each patch. Some parameters do not fit.
    assert [issue for issue in validate(terrain_map) if issue.check != "realized"] == []
    cliffs = Seams(terrain_map=terrain_map).cliffs()
    assert [seam for seam in cliffs if None not in seam.patches] == []


@coarse
@every_default_grid
@pytest.mark.parametrize(("terrain", "block"), CENTERED_BLOCKS)
def test_every_terrain_platform_is_flat_as_recorded(terrain, block, grid):
    declared = parameters_of(registry.get_terrain(terrain))
    # By default, steps below 0.075 m are ramps, which start half a cell earlier.
    threshold = 0.75 if declared[block].slopes_away else 0.05
    for parameters in ({}, {"inverted": True}) if "inverted" in declared else ({},):
        terrain_map = map_of(terrain, parameters, grid, slope_threshold=threshold)
        for row in range(3):
            patch = terrain_map.patch(row, 0)
            side = np.broadcast_to(patch.parameters.realized[block], 2)
            inside, outside = (
                terrain_map.height(patch.grid.center + outline * (side / 2 + margin))
                for margin, outline in ((-1e-3, OUTLINE), (1e-2, OUTLINE))
            )
            assert np.ptp(inside) < 1e-5
            if row == 2 and declared[block].slopes_away:
                assert np.ptp([*outside, inside[0]]) > 1e-4


@pytest.mark.parametrize(
    "rest",
    [
        pytest.param({"slope_threshold": None}, id="no walls"),
        pytest.param({"spawn_radius": 0.7, "spawn_tolerance": 0.0}, id="wide and exact"),
        pytest.param({"centered": True, "border": 0.0}, id="centered"),
    ],
)
@every_terrain
def test_every_terrain_spawn_is_level_on_any_map(terrain, given_parameters, rest):
    grid = Grid(shape=(80, 80), cell=0.1)
    terrain_map = map_of_draws(terrain, given_parameters, grid, cols=4, **rest)
    assert_spawns_are_level(terrain_map, terrain_map.config.spawn_radius)
    assert_spawns_are_inside(terrain_map, terrain_map.config.spawn_radius)


@coarse
@every_terrain
def test_every_terrain_keeps_its_values(terrain, given_parameters):
    recorded = json.loads(VALUES.read_text())[f"{terrain} {json.dumps(given_parameters)}"]
    for found, expected in zip(values_of(terrain, given_parameters), recorded, strict=True):
        assert found.keys() == expected.keys()
        for name, value in expected.items():
            is_text = isinstance(value, str)
            assert found[name] == (value if is_text else pytest.approx(value, 1e-6, 1e-3)), name


def values_of(terrain, parameters):
    """Return parameters and sums of arrays of a patch of difficulty 0 and of one of difficulty 1.

    Each element has another weight in a sum, so that no two can be swapped.
    """
    grid = Grid(shape=(81, 60), cell=0.1)
    terrain_map = map_of(terrain, parameters, grid, rows=2, seed=5)
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


@every_terrain
def test_every_terrain_depends_on_the_seed(terrain, given_parameters):
    grid, rng = Grid(shape=(80, 80), cell=0.1), np.random.default_rng(1)
    one = SubTerrain(terrain=terrain, parameters=given_parameters).at(1.0)
    heights = one.build(grid, rng)
    draws = rng.random() != np.random.default_rng(1).random()
    other = one.build(grid, np.random.default_rng(2))
    assert (heights != other).any() == draws


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
                assert off.max() <= (1 + parameter.slopes_away) * cell + 1e-9


@pytest.mark.parametrize("terrain", registry.terrain_names())
def test_every_terrain_builds_or_rejects_extreme_values(terrain):
    grid = Grid(shape=(80, 80), cell=0.1)
    every_parameter = parameters_of(registry.get_terrain(terrain)).items()
    for (parameter, declared), value in product(every_parameter, (5e-324, MAX_VALUE, 1e308)):
        try:
            choice = SubTerrain(
                terrain=terrain,
                parameters={parameter: [value] if declared.table else type(declared.easy)(value)},
            )
            built = choice.at(1.0)
            heights = built.build(grid, np.random.default_rng(0))
        except TerrainkitError:
            continue
        assert np.isfinite(heights).all(), (parameter, value)
        assert set(built.realized(grid)) == set(built.requested()), (parameter, value)


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
    assert_spawns_are_inside(terrain_map, radius)


if __name__ == "__main__":
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        values = {f"{name} {json.dumps(given)}": values_of(name, given) for name, given in VARIANTS}
    VALUES.write_text(json.dumps(values, indent=0) + "\n")
