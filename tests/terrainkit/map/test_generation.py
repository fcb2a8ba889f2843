import hashlib
import re
import tracemalloc
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, TerrainkitWarning, generate, make_patch
from terrainkit.errors import ConfigError, MemoryLimitError
from terrainkit.map.generation import pad_poses
from tests.tables import read_table
from tests.terrainkit.maps import contents

OBSTACLES, STAIRS = SubTerrain(terrain="obstacles"), SubTerrain(terrain="stairs")
SMALL = MapConfig(
    rows=3, cols=4, patch_size=(8.0, 6.0), border=1.0, terrains=(OBSTACLES, STAIRS), seed=5
)
TALL = MapConfig(
    rows=40,
    cols=2,
    border=1.0,
    spawns_per_patch=3,
    terrains=(SubTerrain(terrain="crawl"), OBSTACLES),
)
"""More patches than tasks of an executor."""


def one_column(terrain, rows=3, **config):
    return MapConfig(rows=rows, cols=1, border=0.0, terrains=(terrain,), **config)


def test_generate_default_map_has_golden_bytes():
    digest = hashlib.sha256(generate(MapConfig()).heights.tobytes()).hexdigest()
    assert digest == "9a9c24156f710fb05dd47d8c548dc0f57a45e1bc51db72d57f0d46942998d05b"


def test_generate_takes_values_in_place_of_those_of_a_config():
    config = MapConfig(rows=2, terrains=(SubTerrain(terrain="stairs"),))
    assert generate(config, cols=1).config == replace(config, cols=1)
    assert generate(rows=1, cols=1, terrains=config.terrains).config.rows == 1


def test_generate_puts_every_patch_at_its_place():
    terrain_map = generate(SMALL)
    # 3 x 80 and 4 x 60 cells, and 10 of border on each side.
    assert terrain_map.heights.shape == terrain_map.grid.shape == (260, 260)
    assert terrain_map.terrain_types.tolist() == [[0, 0, 1, 1]] * 3
    assert terrain_map.terrain_names == ("obstacles", "stairs")
    assert terrain_map.difficulty.tolist() == [[0.0] * 4, [0.5] * 4, [1.0] * 4]
    rest = terrain_map.heights.copy()
    for row, col in np.ndindex(3, 4):
        patch, block = make_patch(SMALL, row, col), (10 + 80 * row, 10 + 60 * col)
        cells = tuple(slice(n, n + size) for n, size in zip(block, (80, 60), strict=True))
        assert patch.heights.tobytes() == terrain_map.heights[cells].tobytes()
        assert contents(replace(terrain_map.patch(row, col), spawn_offset=0.0)) == contents(
            replace(patch, spawn_offset=0.0)
        )
        rest[cells] = 0.0
    assert terrain_map.heights.any()
    assert not rest.any()


def test_pad_poses_fills_with_nan():
    poses = np.empty((1, 2), dtype=object)
    poses[0, 0], poses[0, 1] = np.ones((1, 4)), np.full((2, 4), 2.0)
    nan, none = [np.nan] * 4, np.empty((1, 2), dtype=object)
    np.testing.assert_array_equal(pad_poses(poses), [[[[1] * 4, nan], [[2] * 4] * 2]])
    none[0, 0] = none[0, 1] = np.empty((0, 4))
    assert pad_poses(none).shape == (1, 2, 0, 4)


@pytest.mark.parametrize("mode", ["selected", "randomized"])
def test_generate_obstacles_differ_by_row_without_curriculum(mode):
    terrain_map = generate(one_column(OBSTACLES, rows=2, mode=mode))
    first, second = (terrain_map.patch(row, 0).heights != 0 for row in (0, 1))
    assert (first != second).any()


def test_generate_beyond_memory_is_rejected_early():
    config = MapConfig(rows=10_000, cols=10_000, terrains=(STAIRS,))
    tracemalloc.start()
    with pytest.raises(MemoryLimitError, match="a map of 800500 x 800500 samples needs") as caught:
        generate(config)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    needed = float(re.search(r"needs (\S+) GB of memory; \S+ GB free", str(caught.value))[1])
    # 800500 x 800500 samples of 5 bytes are 3204 GB, and 10^8 patches of 2000 bytes 200 GB.
    assert needed == pytest.approx(3404, abs=1)
    assert peak < 2**24  # imports included


@pytest.mark.parametrize("is_parallel", [False, True])
def test_generate_progress_wraps_every_patch(is_parallel):
    seen = []

    def watch(indices, total):
        for index in indices:
            seen.append((index, total))
            yield index

    with ThreadPoolExecutor(2) as pool:
        config = replace(TALL, cols=3, terrains=(STAIRS,))
        generate(config, progress=watch, executor=pool if is_parallel else None)
    assert seen == [((row, col), 120) for row in range(40) for col in range(3)]


@pytest.mark.parametrize("pool", [ThreadPoolExecutor, ProcessPoolExecutor])
@pytest.mark.parametrize("config", [SMALL, TALL], ids=["small", "tall"])
def test_generate_with_an_executor_gives_the_same_map(pool, config):
    with pool(2) as executor:
        assert contents(generate(config, executor=executor)) == contents(generate(config))


def test_generate_on_a_dask_cluster_gives_the_same_map(tmp_path):
    distributed = pytest.importorskip(
        "distributed", reason="needs the extra distributed: pip install '.[distributed]'"
    )
    cluster = distributed.LocalCluster(
        n_workers=1, threads_per_worker=2, dashboard_address=None, local_directory=tmp_path
    )
    with cluster, distributed.Client(cluster) as client:
        made = generate(TALL, executor=client.get_executor())
    assert contents(made) == contents(generate(TALL))


def test_generate_starts_an_executor_before_the_map_takes_memory(monkeypatch):
    # A process that is forked keeps what the map replaces.
    steps = []
    border_heights = MapConfig.border_heights
    monkeypatch.setattr(
        MapConfig, "border_heights", lambda self: steps.append("map") or border_heights(self)
    )
    with ThreadPoolExecutor(1) as executor:
        submit = executor.submit
        executor.submit = lambda *args: steps.append("patch") or submit(*args)
        generate(TALL, executor=executor)
    assert steps[-1] == "map"
    assert steps.count("map") == 1


def test_generate_with_an_executor_reports_the_first_error_and_cancels_the_rest():
    wide = SubTerrain(terrain="pit", parameters={"side": 20.0})
    config = replace(TALL, terrains=(OBSTACLES, wide))
    with pytest.raises(ConfigError, match=r"^patch \(0, 1\): pit: side 20 m does not") as serial:
        generate(config)
    submitted = []
    with ThreadPoolExecutor(1) as executor:
        submit = executor.submit
        executor.submit = lambda *args: submitted.append(submit(*args)) or submitted[-1]
        with pytest.raises(ConfigError) as caught:
            generate(config, executor=executor)
    assert str(caught.value) == str(serial.value)
    assert submitted[-1].cancelled()


@pytest.mark.parametrize(
    ("terrain", "given", "message"),
    read_table(__file__, "generate_warns_of_what_the_cells_or_patches_do_not_allow"),
)
def test_generate_warns_of_what_the_cells_or_patches_do_not_allow(terrain, given, message):
    config = one_column(SubTerrain(terrain=terrain, parameters=given))
    with pytest.warns(TerrainkitWarning, match=message):
        generate(config)
    if isinstance(next(iter(given.values())), list):
        generate(replace(config, rows=1))  # one value is no range
        if terrain == "stepping_stones":
            generate(replace(config, cell=0.02))
