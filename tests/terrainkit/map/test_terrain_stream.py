import json
import os
import time
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, TerrainkitWarning, TerrainStream, generate
from terrainkit.errors import ConfigError, MemoryLimitError
from tests.terrainkit.maps import contents

ALL = MapConfig(preset="all", border=1.0, spawns_per_patch=2)
NUM_TERRAINS = len(ALL.sub_terrains)
ROUGH, PIT = SubTerrain(terrain="rough", proportion=0.0), SubTerrain(terrain="pit")
SMALL = MapConfig(patch_size=(5.0, 6.0), border=1.0, terrains=(ROUGH, PIT))


def values(maps):
    return [contents(terrain_map) for terrain_map in maps]


@pytest.fixture(scope="module")
def generated():
    """Return a map of each terrain: environment i is on terrain i, at its second episode."""
    stream = TerrainStream(ALL, 3)
    difficulties = np.linspace(0, 1, NUM_TERRAINS).tolist()
    configs = [stream.map_config(k, 1, k, value) for k, value in enumerate(difficulties)]
    with pytest.warns(TerrainkitWarning):  # about single patches
        return values(map(generate, configs))


@pytest.mark.parametrize("jobs", [0, 1, 3])
def test_maps_equal_those_of_generate(generated, jobs):
    env_ids, difficulties = np.arange(NUM_TERRAINS), np.linspace(0, 1, NUM_TERRAINS)
    with ProcessPoolExecutor(jobs or 1) as executor:
        stream = TerrainStream(ALL, 3, executor=executor if jobs else None)
        stream.load_state_dict(dict.fromkeys(env_ids.tolist(), 1))
        stream.prefetch(env_ids[::-1], env_ids[::-1], difficulties[::-1])
        assert values(stream.next_maps(env_ids, env_ids, difficulties)) == generated


def test_map_config_has_one_patch_of_the_sub_terrain_and_a_seed_of_its_own():
    config = TerrainStream(SMALL, 5).map_config(2, 7, 0, 0.3)
    seed = int(np.random.SeedSequence([5, 2, 7]).generate_state(1, np.uint64)[0] >> 1)
    assert config == replace(
        SMALL,
        rows=1,
        cols=1,
        mode="selected",
        selected_difficulty=0.3,
        terrains=(replace(ROUGH, proportion=1.0),),
        seed=seed,
    )
    assert MapConfig.from_toml(config.to_toml()) == config


def test_maps_do_not_depend_on_the_order_or_on_what_was_prefetched():
    expected = [values(TerrainStream(SMALL, 1).next_maps([k], [0], 0.5))[0] for k in range(3)]
    with ProcessPoolExecutor(2) as executor:
        stream = TerrainStream(SMALL, 1, executor=executor, max_ahead=3)
        stream.prefetch([0, 0, 1, 2, 2], [1, 0, 1, 0, 0], [0.5, 0.4, 0.5, 0.5, 0.6])
        maps = stream.next_maps([2, 0], [0, 0], 0.5) + stream.next_maps([1], [0], [0.5])
    assert values(maps) == [expected[k] for k in (2, 0, 1)]
    assert expected[0]["heights"] != expected[1]["heights"]


def test_stream_continues_from_its_state():
    stream = TerrainStream(SMALL, 1)
    stream.next_maps([4, 9], [0, 1], 0.5)
    stream.next_maps([9], [0], 0.5)
    state = json.loads(json.dumps(stream.state_dict()))
    assert state == {"4": 1, "9": 2}
    with ProcessPoolExecutor(1) as executor:
        resumed = TerrainStream(SMALL, 1, executor=executor)
        resumed.prefetch([9], [0], 0.5)  # of an episode before
        resumed.load_state_dict(state)
        maps = [own.next_maps([4, 9], [0, 0], 0.5) for own in (stream, resumed)]
    assert values(maps[0]) == values(maps[1])


def end_late():
    time.sleep(0.5)
    os._exit(1)


@pytest.mark.parametrize("is_late", [False, True])
def test_ended_process_changes_no_map(is_late):
    def next_maps(stream):
        stream.prefetch(range(6), [0] * 6, 0.5)
        return stream.next_maps(range(6), [0] * 6, 0.5) + stream.next_maps([0], [1], 0.5)

    with ProcessPoolExecutor(1) as executor:
        stream = TerrainStream(SMALL, 1, executor=executor)
        future = executor.submit(end_late)
        assert is_late or future.exception()
        with pytest.warns(TerrainkitWarning, match="an executor failed: Broken.*") as warned:
            maps = next_maps(stream)
    assert len(warned) == 1
    assert values(maps) == values(next_maps(TerrainStream(SMALL, 1)))


def test_prefetch_is_limited():
    futures = []

    def submit(*_):
        futures.append(Mock(spec=Future))
        return futures[-1]

    executor = Mock(spec=Executor, submit=submit)
    stream = TerrainStream(SMALL, 1, executor=executor, max_ahead=2)
    for _ in range(10):
        stream.prefetch([0, 1, 2], [0, 0, 0], 0.5)
    assert len(futures) == 2
    stream.next_maps([0], [1], 0.5)
    futures[0].cancel.assert_called_once_with()
    stream.prefetch([0, 1, 2], [0, 0, 0], 0.5)
    assert len(futures) == 3


def test_stream_beyond_memory_is_rejected_early():
    # 10^6 patches of 10^6 samples of 8 bytes, and 2000 bytes each.
    with pytest.raises(MemoryLimitError, match=r"max_ahead 1000000 needs 8002\.00 GB"):
        TerrainStream(replace(SMALL, patch_size=(100.0, 100.0)), max_ahead=10**6)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([0, 0], [0, 0], 0.5), "env_ids: got an environment twice; expected each once"),
        (([-1], [0], 0.5), "env_ids: got -1 to -1; expected 0 to"),
        (([0], [2], 0.5), "terrains: got 2 to 2; expected 0 to 1"),
        (([0], [0], 1.5), "difficulty: got 1.5; expected a number"),
        (([0, 1], [0, 0], [0.5]), r"difficulties: got shape \(1,\); expected \(2,\)"),
    ],
)
def test_next_maps_rejects(arguments, message):
    with pytest.raises(ConfigError, match=message):
        TerrainStream(SMALL).next_maps(*arguments)


@pytest.mark.parametrize("jobs", [0, 1])
def test_episode_without_a_map_does_not_count(jobs):
    config = replace(SMALL, patch_size=(3.0, 3.0))
    with ProcessPoolExecutor(jobs or 1) as executor:
        stream = TerrainStream(config, executor=executor if jobs else None)
        stream.prefetch([1], [1], 0.5)
        with pytest.raises(ConfigError, match=r"^patch \(0, 0\): pit"):
            stream.next_maps([0, 1], [0, 1], 0.5)
    assert stream.state_dict() == {}


def test_stream_of_an_imported_map_is_rejected():
    with pytest.raises(ConfigError, match="mode custom: the map was imported or edited"):
        TerrainStream(replace(SMALL, mode="custom"))
