import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain
from terrainkit.errors import ConfigError
from terrainkit.overlays.noise import Noise
from terrainkit.overlays.rotate import Rotate
from tests.tables import read_table

FLAT = SubTerrain(terrain="flat")
GAP = '[[terrains]]\nterrain = "gap"\n'


@pytest.mark.parametrize(
    "values",
    [
        {"rows": 3, "patch_size": (7.3, 5.1), "cell": 0.05, "preset": "stairs", "centered": True},
        {"mode": "randomized", "random_difficulties": (0.1, 1.0), "seed": 2**63 - 1},
        {"mode": "selected", "selected_difficulty": 0.3, "terrains": (FLAT,)},
        {"slope_threshold": None, "spawn_tolerance": 1e-7, "spawns_per_patch": 3},
        {"terrains": (SubTerrain(terrain="gap", proportion=0.25, parameters={"width": (0, 0.7)}),)},
        {"terrains": (SubTerrain(terrain="slope", name='a "wide" gap, ü\n', friction=0.5),)},
        {"terrains": (SubTerrain(terrain="slope", parameters={"inverted": np.True_}),)},
        {"terrains": (SubTerrain(terrain="wave", parameters={"number": np.int64(3)}),)},
    ],
    ids=range(8),
)
def test_toml_round_trip(values):
    config = MapConfig(**values)
    assert MapConfig.from_toml(config.to_toml()) == config


def test_toml_has_the_preset_or_the_terrains():
    custom, preset = MapConfig(preset="rough", terrains=(FLAT,)), MapConfig(preset="rough")
    assert "preset" not in custom.to_table()
    assert "terrains" not in preset.to_table()
    assert 'slope_threshold = "none"' in MapConfig(slope_threshold=None).to_toml()


def test_handwritten_file_is_read():
    text = read_table(__file__, "handwritten_file_is_read")
    overlays = (Noise(amplitude=(0.0, 0.1)), Rotate(degrees="random"))
    config = MapConfig.from_toml(text)
    assert config == MapConfig(
        rows=4,
        patch_size=(8.0, 4.0),
        slope_threshold=None,
        terrains=(
            SubTerrain(terrain="stairs", proportion=2, parameters={"step_height": (0.05, 0.2)}),
            SubTerrain(terrain="gap", name="down", friction=(1.0, 0.5), overlays=overlays),
        ),
    )
    assert MapConfig.from_toml(config.to_toml()) == config
    assert MapConfig.from_toml("") == MapConfig()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        *read_table(__file__, "invalid_toml_is_rejected_on_one_line"),
        (GAP + 'width = "1"', r"terrains\[0\]: gap\.width: got '1'; expected a number"),
        (GAP + 'overlays = [{overlay = "nois"}]', r"overlays\[0\]: no overlay 'nois' .*'noise'"),
    ],
)
def test_invalid_toml_is_rejected_on_one_line(text, message):
    with pytest.raises(ConfigError, match=message) as caught:
        MapConfig.from_toml(text)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"row = 3", "map.toml: config has no key 'row'"),
    ],
)
def test_load_error_names_the_file(tmp_path, data, message):
    path = tmp_path / "map.toml"
    path.write_bytes(data)
    with pytest.raises(ConfigError, match=message):
        MapConfig.load(path)
    path.write_bytes(b"rows = 3\n".ljust(2**20))
    assert MapConfig.load(path) == MapConfig.load(str(path)) == MapConfig(rows=3)
