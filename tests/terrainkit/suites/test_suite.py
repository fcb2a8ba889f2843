import dataclasses
import hashlib

import numpy as np
import pytest

import terrainkit
from terrainkit import suites
from terrainkit.errors import ConfigError, TerrainkitError
from terrainkit.geometry.solids import Solids
from terrainkit.map.validate import validate
from terrainkit.terrain.parameter import parameters_of
from tests.tables import read_table

HASHES = read_table(__file__, "hashes")
"""Those that were released never change: a changed suite needs a new version."""


@pytest.mark.parametrize("name", HASHES)
def test_suite_has_its_hash_and_every_parameter_and_is_valid(name):
    terrain_map = terrainkit.generate_suite(name)
    for sub_terrain in terrain_map.config.terrains:
        assert list(sub_terrain.parameters) == list(parameters_of(sub_terrain.terrain_class))
    assert terrainkit.suite_hash(terrain_map) == HASHES[name]
    assert validate(terrain_map) == []
    assert terrain_map.terrain_types.tolist() == [[*range(terrain_map.config.cols)]] * 10


def test_suite_names_are_those_with_a_hash():
    assert list(terrainkit.suite_names()) == list(HASHES)
    assert {name: terrainkit.get_suite(name).sha256 for name in HASHES} == HASHES


@pytest.mark.parametrize("name", ["basics-2", "response-1", ""])
def test_unknown_suite_lists_the_suites(name):
    with pytest.raises(ConfigError, match=f"no suite '{name}'.*basics-1, response-1-small"):
        terrainkit.get_suite(name)


@pytest.mark.parametrize(("scale", "factor"), [("small", 0.5), ("large", 2.0)])
def test_response_scales_differ_by_a_factor(scale, factor):
    medium, scaled = (
        {each.name: each.parameters for each in terrainkit.get_suite(name).config.terrains}
        for name in ("response-1-medium", f"response-1-{scale}")
    )
    angles_and_ratios = {"grade", "roll", "opening", "inverted", "layers", "number", "half"}
    for name in (medium.keys() & scaled.keys()) - {"pallets", "half_pallets"}:
        for parameter, value in medium[name].items():
            same = parameter in angles_and_ratios or isinstance(value, str)
            expected = value if same else np.multiply(value, factor)
            assert scaled[name][parameter] == pytest.approx(expected), (name, parameter)


def test_generate_suite_rejects_a_map_with_another_hash(monkeypatch):
    monkeypatch.setitem(suites.suite._SHA256, "natural-1", "0" * 64)
    with pytest.raises(TerrainkitError, match="suite natural-1: got a map with SHA-256 7"):
        terrainkit.generate_suite("natural-1")


@pytest.fixture(scope="module")
def small_map():
    crawl = terrainkit.SubTerrain(terrain="crawl")
    return terrainkit.generate(terrainkit.MapConfig(rows=1, cols=1, border=0, terrains=(crawl,)))


def test_suite_hash_of_flat_ground_by_hand():
    flat = terrainkit.SubTerrain(terrain="flat")
    config = terrainkit.MapConfig(
        rows=1, cols=1, border=0, cell=0.5, patch_size=(2.0, 2.0), terrains=(flat,)
    )
    values = [
        (4, 4, *[0] * 16),  # heights
        (4, 4, *[10_000] * 16),  # friction 1
        *((0, 10), (0, 10), (0, 3), (0,), (0,), (0,), (0,), (0, 2)),  # no solids
        (1, 1, 1, 4, 10_000, 10_000, 0, 0),  # spawn at (1, 1, 0) with heading 0
        (1, 1, 0, 4),  # no goals
    ]
    words = np.concatenate([np.array(each, dtype="<i4") for each in values])
    got = terrainkit.suite_hash(terrainkit.generate(config))
    assert got == hashlib.sha256(words.tobytes()).hexdigest()


@pytest.mark.parametrize("name", ["heights", "friction", "spawns", "goals"])
def test_suite_hash_depends_on_arrays_to_a_tenth_of_a_millimeter(small_map, name):
    array = np.array(getattr(small_map, name))

    def hash_with(change):
        changed = array.copy()
        changed.flat[0] += change
        return terrainkit.suite_hash(dataclasses.replace(small_map, **{name: changed}))

    assert hash_with(1e-6) == terrainkit.suite_hash(small_map) != hash_with(1e-4)


@pytest.mark.parametrize("name", [each.name for each in dataclasses.fields(Solids)])
def test_suite_hash_depends_on_solids(small_map, name):
    solids = small_map.solids
    array = np.array(getattr(solids, name))
    changed = array[:-1] if array.size else np.ones((1, *array.shape[1:]), array.dtype)
    other = dataclasses.replace(solids, **{name: changed})
    changed_map = dataclasses.replace(small_map, solids=other)
    assert terrainkit.suite_hash(changed_map) != terrainkit.suite_hash(small_map)


def test_suite_hash_rejects_values_beyond_int32(small_map):
    goals = np.full_like(small_map.goals, 3e5)
    with pytest.raises(ConfigError, match="goals: got values up to 300000; expected at most 21474"):
        terrainkit.suite_hash(dataclasses.replace(small_map, goals=goals))
