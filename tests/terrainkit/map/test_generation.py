import hashlib
import os
import re
import subprocess
import sys
import tracemalloc
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import fields, replace

import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, TerrainkitWarning, generate, make_patch
from terrainkit.errors import ConfigError, MemoryLimitError, TerrainkitError
from terrainkit.map.config import Mode
from terrainkit.map.measured_difficulty import measured_difficulty

OBSTACLES, ROUGH, STAIRS = (SubTerrain(terrain=name) for name in ("obstacles", "rough", "stairs"))
NUMBERS = [field.name for field in fields(MapConfig) if field.type in (float, float | None)]
SMALL = MapConfig(
    rows=3, cols=4, patch_size=(8.0, 6.0), border=1.0, terrains=(OBSTACLES, STAIRS), seed=5
)


def sha256(terrain_map):
    return hashlib.sha256(terrain_map.heights.tobytes()).hexdigest()


def test_generate_default_map_has_golden_bytes():
    terrain_map = generate(MapConfig())
    assert terrain_map.heights.shape == (1300, 1300)
    assert sha256(terrain_map) == (
        "1454113576474cb6fc191cdb81c8c11159fb6d4c13560015f863ec9b0277be95"
    )


def test_generate_is_the_same_in_another_process():
    code = (
        "import hashlib, terrainkit as t;"
        "m = t.generate(t.MapConfig(rows=3, cols=5, preset='rough', border=0.0, seed=3));"
        "print(hashlib.sha256(m.heights.tobytes()).hexdigest())"
    )
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path), "PYTHONHASHSEED": "1"}
    other = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    here = generate(MapConfig(rows=3, cols=5, preset="rough", border=0.0, seed=3))
    assert other.stdout.strip() == sha256(here)


def test_generate_depends_on_the_seed():
    assert sha256(generate(MapConfig(seed=1))) != sha256(generate(MapConfig(seed=2)))


def test_generate_arrays_have_their_shapes():
    terrain_map = generate(SMALL)
    # 3 x 80 and 4 x 60 cells, and 10 of border on each side.
    assert terrain_map.heights.shape == terrain_map.grid.shape == (260, 260)
    assert terrain_map.heights.dtype == np.float32
    assert terrain_map.env_origins.shape == (3, 4, 3)
    assert terrain_map.terrain_types.tolist() == [[0, 0, 1, 1]] * 3
    assert terrain_map.terrain_names == ("obstacles", "stairs")
    assert terrain_map.difficulty[:, 0].tolist() == [0.0, 0.5, 1.0]
    assert terrain_map.parameters[2, 3].requested["step_height"] == 0.23


def test_generate_border_is_level_at_zero():
    heights = generate(SMALL).heights.copy()
    assert heights.any()
    heights[10:-10, 10:-10] = 0.0
    assert not heights.any()


@pytest.mark.parametrize(("row", "col"), [(0, 0), (1, 2), (2, 0), (2, 3)])
def test_make_patch_equals_slice_of_the_map(row, col):
    terrain_map, patch = generate(SMALL), make_patch(SMALL, row, col)
    i, j = 10 + 80 * row, 10 + 60 * col
    assert patch.heights.tobytes() == terrain_map.heights[i : i + 80, j : j + 60].tobytes()
    assert patch.origin.tobytes() == terrain_map.env_origins[row, col].tobytes()
    assert patch.difficulty == terrain_map.difficulty[row, col]
    assert patch.parameters == terrain_map.parameters[row, col]


def test_generate_spawns_begin_with_the_origin():
    one, many = generate(SMALL), generate(replace(SMALL, spawns_per_patch=5, spawn_radius=0.3))
    assert one.spawns.shape == (3, 4, 1, 4)
    assert many.spawns.shape == (3, 4, 5, 4)
    assert many.spawns[:, :, 0].tobytes() == one.spawns[:, :, 0].tobytes()
    assert many.heights.tobytes() == one.heights.tobytes()
    assert (many.spawns[0, 0] != many.spawns[1, 0]).any()


def test_generate_pads_spawns_with_nan():
    flat = SubTerrain(terrain="flat")
    # The platform of 1.5 m has room for one disk with a radius of 0.5 m only.
    small = SubTerrain(terrain="pyramid_stairs", parameters={"platform": 1.5})
    config = replace(SMALL, cols=2, spawns_per_patch=6, terrains=(flat, small))
    number = np.isfinite(generate(config).spawns).sum(axis=2)
    assert number.tolist() == [[[6] * 4, [1] * 4]] * 3


def test_generate_change_of_one_column_is_local():
    edited = SubTerrain(terrain="stairs", parameters={"step_height": 0.3, "inverted": True})
    before = generate(SMALL).heights
    after = generate(replace(SMALL, terrains=(OBSTACLES, edited))).heights
    start = 10 + 2 * 60  # the third column is the first of the stairs
    assert before[:, :start].tobytes() == after[:, :start].tobytes()
    assert (before[:, start:] != after[:, start:]).any()


def test_generate_more_rows_keep_the_first_ones():
    few = MapConfig(rows=2, cols=2, border=0.0, terrains=(OBSTACLES,))
    many = MapConfig(rows=5, cols=3, border=0.0, terrains=(OBSTACLES,))
    assert make_patch(few, 0, 1).heights.tobytes() == make_patch(many, 0, 1).heights.tobytes()


@pytest.mark.parametrize("seed", range(3))
def test_generate_obstacles_differ_only_in_height_along_column(seed):
    terrain_map = generate(MapConfig(rows=4, cols=3, border=0.0, terrains=(OBSTACLES,), seed=seed))
    easy, *_, hard = (terrain_map.patch(row, 1).heights for row in range(4))
    assert easy.any()
    assert hard == pytest.approx(5 * easy, abs=1e-6)  # 0.05 and 0.25 m
    assert (terrain_map.patch(0, 0).heights != easy).any()
    for col in range(3):
        patches = [terrain_map.patch(row, col) for row in range(4)]
        hard = [measured_difficulty(p.heights, 0.1, float(p.origin[2])) for p in patches]
        assert np.diff(hard).min() > 0


@pytest.mark.parametrize("mode", ["selected", "randomized"])
def test_generate_obstacles_differ_by_row_without_curriculum(mode):
    config = MapConfig(rows=2, cols=1, border=0.0, terrains=(OBSTACLES,), mode=mode)
    first, second = (generate(config).patch(row, 0).heights != 0 for row in (0, 1))
    assert (first != second).any()


def test_generate_centered_only_moves_the_map():
    corner, middle = generate(SMALL), generate(replace(SMALL, centered=True))
    assert corner.heights.tobytes() == middle.heights.tobytes()
    assert corner.grid.lower == (-1.0, -1.0)
    assert middle.grid.center == pytest.approx((0.0, 0.0))
    # Half of 3 x 8 m and of 4 x 6 m.
    moved = middle.env_origins - corner.env_origins
    assert np.abs(moved - (-12.0, -12.0, 0.0)).max() < 1e-5


@pytest.mark.parametrize("mode", sorted({*Mode.__args__} - {"custom"}))
def test_generate_supports_every_mode(mode):
    terrain_map = generate(MapConfig(rows=2, cols=2, border=0.0, mode=mode, terrains=(STAIRS,)))
    expected = {"curriculum": {0.0, 1.0}, "selected": {1.0}}.get(mode, {0.5, 0.75, 0.9})
    assert set(terrain_map.difficulty.astype(float).round(6).flat) <= expected


def test_generate_beyond_memory_is_rejected_early():
    config = MapConfig(rows=10_000, cols=10_000, terrains=(STAIRS,))
    tracemalloc.start()
    with pytest.raises(MemoryLimitError, match="a map of 800500 x 800500 samples needs") as caught:
        generate(config)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    needed = float(re.search(r"needs (\S+) GB of memory; \S+ GB free", str(caught.value))[1])
    # 800500 x 800500 heights of 4 bytes are 2563 GB.
    assert 2563 <= needed < 3500
    assert peak < 2**24  # imports included


@pytest.mark.parametrize(
    "given",
    [{name: value} for name in NUMBERS for value in (5e-324, 1e308)]
    + [
        {"patch_size": (8e-310, 8e-310), "cell": 1e-311},
        {"patch_size": (8e300, 8e300), "cell": 1e299},
        {"patch_size": (1e307, 1e307), "rows": 100, "centered": True},
    ],
    ids=lambda given: " ".join(f"{name}={value}" for name, value in given.items()),
)
def test_generate_builds_or_rejects_extreme_values(given):
    small = {"rows": 1, "cols": 1, "border": 0.0, "terrains": (ROUGH,)}
    try:
        terrain_map = generate(MapConfig(**small | given))
    except TerrainkitError:
        return
    assert np.isfinite(terrain_map.heights).all()
    assert np.isfinite(terrain_map.env_origins).all()
    assert np.isfinite(terrain_map.height(np.array([[4.0, 4.0]]))).all()


def test_generate_ignores_global_random_state():
    np.random.seed(1)  # noqa: NPY002
    first = generate(SMALL)
    after = np.random.random()  # noqa: NPY002
    np.random.seed(1)  # noqa: NPY002
    assert after == np.random.random()  # noqa: NPY002
    assert sha256(generate(SMALL)) == sha256(first)


def test_generate_progress_wraps_every_patch():
    seen = []

    def watch(walk, total):
        seen.append(total)
        for place in walk:
            seen.append(place)
            yield place

    generate(MapConfig(rows=2, cols=2, border=0.0, terrains=(STAIRS,)), progress=watch)
    assert seen == [4, (0, 0), (0, 1), (1, 0), (1, 1)]


CRAWL = SubTerrain(terrain="crawl")
TALL = MapConfig(rows=40, cols=2, border=1.0, spawns_per_patch=3, terrains=(CRAWL, OBSTACLES))
"""More patches than tasks of an executor."""


def same_bytes(one, other):
    arrays = ("heights", "spawns", "terrain_types", "difficulty", "goals")
    solids = ("boxes", "friction", "collides", "visible", "patch")
    return (
        all(getattr(one, name).tobytes() == getattr(other, name).tobytes() for name in arrays)
        and all(
            getattr(one.solids, name).tobytes() == getattr(other.solids, name).tobytes()
            for name in solids
        )
        and one.parameters.tolist() == other.parameters.tolist()
    )


@pytest.mark.parametrize("pool", [ThreadPoolExecutor, ProcessPoolExecutor])
@pytest.mark.parametrize("config", [SMALL, TALL], ids=["small", "tall"])
def test_generate_with_an_executor_gives_same_bytes(pool, config):
    with pool(2) as executor:
        assert same_bytes(generate(config, executor=executor), generate(config))


def test_generate_on_a_dask_cluster_gives_same_bytes(tmp_path):
    distributed = pytest.importorskip(
        "distributed", reason="needs the extra distributed: pip install '.[distributed]'"
    )
    cluster = distributed.LocalCluster(
        n_workers=1, threads_per_worker=2, dashboard_address=None, local_directory=tmp_path
    )
    with cluster, distributed.Client(cluster) as client:
        made = generate(TALL, executor=client.get_executor())
    assert same_bytes(made, generate(TALL))


def test_generate_with_an_executor_wraps_every_patch():
    seen = []

    def watch(indices, total):
        for index in indices:
            seen.append((index, total))
            yield index

    with ThreadPoolExecutor(2) as executor:
        generate(TALL, progress=watch, executor=executor)
    assert seen == [((row, col), 80) for row in range(40) for col in range(2)]


def test_generate_with_an_executor_reports_the_first_error():
    wide = SubTerrain(terrain="pit", parameters={"side": 20.0})
    config = replace(TALL, terrains=(OBSTACLES, wide))
    with pytest.raises(ConfigError) as serial:
        generate(config)
    with ProcessPoolExecutor(2) as executor, pytest.raises(ConfigError) as caught:
        generate(config, executor=executor)
    assert str(caught.value) == str(serial.value)


def test_generate_warns_of_step_above_amplitude():
    choice = SubTerrain(terrain="rough", parameters={"amplitude": 0.004})
    with pytest.warns(TerrainkitWarning, match=r"height steps .* rough\.amplitude on 1 patch"):
        made = generate(MapConfig(rows=1, cols=1, border=0.0, terrains=(choice,)))
    assert not made.heights.any()


@pytest.mark.parametrize(
    ("terrain", "given", "collapsed"),
    [
        ("stepping_stones", {"distance": (0.05, 0.1)}, "distance from 0.05 to 0.1 is 0.1"),
        ("stepping_stones", {"stone": (0.26, 0.34)}, "stone from 0.26 to 0.34 is 0.3"),
        ("rough", {"amplitude": (0.02, 0.024)}, "amplitude from 0.02 to 0.024 is 0.02"),
    ],
)
def test_generate_warns_of_a_collapsed_range(terrain, given, collapsed):
    choice = SubTerrain(terrain=terrain, parameters=given)
    config = MapConfig(rows=3, cols=1, border=0.0, terrains=(choice,))
    with pytest.warns(TerrainkitWarning, match=f"{terrain}.{collapsed} on every patch"):
        generate(config)
    generate(replace(config, rows=1))
    if terrain == "stepping_stones":
        generate(replace(config, cell=0.02))


@pytest.mark.parametrize(
    ("terrain", "given"),
    [
        ("gap", {"platform": 1.0}),
        ("pit", {"side": 1.0}),
        ("stairs", {"landing": 1.0, "step_width": 0.7}),
    ],
)
def test_generate_warns_of_moved_spawn(terrain, given):
    choice = SubTerrain(terrain=terrain, parameters=given)
    config = MapConfig(rows=3, cols=1, border=0.0, difficulty_range=(0.5, 1.0), terrains=(choice,))
    with pytest.warns(
        TerrainkitWarning, match=f"at the preferred spawn position: {terrain} on 3 patch"
    ):
        generate(config)


def test_generate_warns_once_of_missing_columns():
    with pytest.warns(
        TerrainkitWarning, match="cols: got 2, .*no column for rough_slope, "
    ) as caught:
        generate(MapConfig(rows=2, cols=2, preset="rough", border=0.0))
    assert len(caught) == 1


def test_generate_rejects_terrain_that_does_not_fit():
    with pytest.raises(ConfigError, match=r"stairs: two landings of 2 m leave no step"):
        generate(MapConfig(patch_size=(3.0, 3.0), terrains=(STAIRS,)))
