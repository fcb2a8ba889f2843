import dataclasses
import os

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terrainkit import MapConfig, SubTerrain
from terrainkit.errors import ConfigError
from terrainkit.overlays.noise import Noise
from terrainkit.overlays.rotate import Rotate

FLAT = SubTerrain(terrain="flat")
NOT_THE_DEFAULT = {
    "rows": 3,
    "cols": 4,
    "patch_size": (7.3, 5.1),
    "cell": 0.05,
    "border": 2.5,
    "preset": "stairs",
    "terrains": (
        SubTerrain(terrain="gap", proportion=0.25, parameters={"width": (0.2, 0.7)}),
        SubTerrain(terrain="gap", name='a "wide" gap, ü\n', parameters={"width": 1, "depth": 2.5}),
        SubTerrain(terrain="slope", parameters={"inverted": True}),
        SubTerrain(terrain="wave", parameters={"number": 3}),
    ),
    "mode": "randomized",
    "difficulty_range": (0.25, 0.75),
    "difficulty_jitter": 0.5,
    "random_difficulties": (0.1, 1.0),
    "selected_difficulty": 0.3,
    "seed": 2**63 - 1,
    "centered": True,
    "slope_threshold": None,
    "spawn_radius": 0.3,
    "spawn_tolerance": 1e-7,
    "spawns_per_patch": 3,
    "spawn_headroom": 2.5,
    "static_friction": 0.8,
    "dynamic_friction": 0.6,
    "restitution": 0.1,
}


@pytest.mark.parametrize("name", [field.name for field in dataclasses.fields(MapConfig)])
def test_toml_round_trip_of_each_field(name):
    config = MapConfig(**{name: NOT_THE_DEFAULT[name]})
    assert config != MapConfig()
    assert MapConfig.from_toml(config.to_toml()) == config


@pytest.mark.parametrize(
    ("overlays", "message"),
    [
        ("overlays = 3", "overlays: got 3; expected"),
        ("overlays = [3]", r"overlays: got .*; expected \[\[terrains\.overlays\]\] tables"),
        ("[[terrains.overlays]]", r"overlays\[0\]: overlay: got None; expected a string"),
        (
            '[[terrains.overlays]]\noverlay = "nois"',
            r"overlays\[0\]: no overlay 'nois' .*; did you mean 'noise'",
        ),
        (
            '[[terrains.overlays]]\noverlay = "noise"\namplitud = 1.0',
            r"overlays\[0\]: noise has no parameter 'amplitud'; did you mean 'amplitude'",
        ),
        (
            '[[terrains.overlays]]\noverlay = "noise"\namplitude = [1.0, 2.0, 3.0]',
            r"noise\.amplitude: got \[1\.0, 2\.0, 3\.0\]; expected one value or a pair",
        ),
        (
            '[[terrains.overlays]]\noverlay = "rotate"\ndegrees = 45',
            "expected one of: 90, 180",
        ),
    ],
)
def test_invalid_overlay_in_toml_is_rejected(overlays, message):
    with pytest.raises(ConfigError, match=message):
        MapConfig.from_toml(f'[[terrains]]\nterrain = "gap"\n{overlays}')


def test_toml_of_friction_and_overlays():
    config = MapConfig.from_toml(
        """
        [[terrains]]
        terrain = "gap"
        friction = [1, 0.5]
        [[terrains.overlays]]
        overlay = "noise"
        amplitude = [0, 0.1]
        [[terrains.overlays]]
        overlay = "rotate"
        degrees = "random"
        """
    )
    (gap,) = config.terrains
    assert gap.friction == (1.0, 0.5)
    assert gap.overlays == (Noise(amplitude=(0.0, 0.1)), Rotate(degrees="random"))
    assert MapConfig.from_toml(config.to_toml()) == config


def test_toml_round_trip_of_mode_selected():
    config = MapConfig(mode="selected", terrains=(FLAT,), selected_difficulty=0.4)
    assert MapConfig.from_toml(config.to_toml()) == config


def test_custom_terrains_are_written_without_preset():
    config = MapConfig(preset="rough", terrains=(FLAT,))
    assert "preset" not in config.to_toml()
    assert MapConfig.from_toml(config.to_toml()) == config


@pytest.mark.parametrize(
    ("terrain", "parameters"),
    [
        ("gap", {"width": np.float32(0.5)}),
        ("gap", {"width": (np.float32(0.5), np.int64(1))}),
        ("wave", {"number": np.int64(3)}),
        ("slope", {"inverted": np.True_}),
    ],
    ids=["number", "range", "count", "switch"],
)
def test_toml_round_trip_of_numpy_scalars(terrain, parameters):
    config = MapConfig(terrains=(SubTerrain(terrain=terrain, parameters=parameters),))
    assert MapConfig.from_toml(config.to_toml()) == config


@settings(deadline=None, derandomize=True, max_examples=50)
@given(
    rows=st.integers(1, 10_000),
    seed=st.integers(0, 2**63 - 1),
    threshold=st.none() | st.floats(1e-3, 1e6),
    friction=st.floats(0, 1e6),
    difficulties=st.lists(st.floats(0, 1), min_size=1, max_size=4),
    name=st.text(st.characters(codec="utf-8"), min_size=1),
    width=st.floats(0, 1e6) | st.tuples(st.floats(0, 1e6), st.integers(0, 10)),
)
def test_toml_round_trip(rows, seed, threshold, friction, difficulties, name, width):
    config = MapConfig(
        rows=rows,
        seed=seed,
        slope_threshold=threshold,
        static_friction=friction,
        random_difficulties=tuple(difficulties),
        terrains=(SubTerrain(terrain="gap", name=name, parameters={"width": width}),),
    )
    assert MapConfig.from_toml(config.to_toml()) == config


def test_none_is_written_as_a_string():
    assert 'slope_threshold = "none"' in MapConfig(slope_threshold=None).to_toml()


def test_missing_keys_have_defaults():
    assert MapConfig.from_toml("") == MapConfig()


def test_handwritten_file_is_read():
    text = """
        rows = 4
        patch_size = [8, 4]     # whole numbers will do
        slope_threshold = "none"

        [[terrains]]
        terrain = "stairs"
        proportion = 2
        step_height = [0.05, 0.2]

        [[terrains]]
        terrain = "stairs"
        name = "down"
        inverted = true
    """
    assert MapConfig.from_toml(text) == MapConfig(
        rows=4,
        patch_size=(8.0, 4.0),
        slope_threshold=None,
        terrains=(
            SubTerrain(terrain="stairs", proportion=2, parameters={"step_height": (0.05, 0.2)}),
            SubTerrain(terrain="stairs", name="down", parameters={"inverted": True}),
        ),
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("row = 3", "config has no key 'row'; did you mean 'rows'. It has: rows, cols, patch_"),
        ("[map]\nrows = 3", "config has no key 'map'; it has: rows, "),
        (
            '[[terrains]]\nterrain = "lava"',
            "no terrain 'lava' is built in, .*; terrainkit list prints all",
        ),
        (
            '[[terrains]]\nterrain = "gap"\nwidht = 1.0',
            "gap has no parameter 'widht'; did you mean 'width'. It has: width, depth, platform",
        ),
    ],
)
def test_unknown_key_lists_known_keys(text, message):
    with pytest.raises(ConfigError, match=message):
        MapConfig.from_toml(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("rows = 3.0", r"rows: got 3\.0; expected an integer"),
        ('rows = "3"', "rows: got '3'; expected an integer"),
        ("rows = true", "rows: got True; expected an integer"),
        ("rows = 2000-01-01", r"rows: got datetime\.date\(2000, 1, 1\); expected an integer"),
        ("rows = [3]", r"rows: got \[3\]; expected an integer"),
        ("rows = {}", "rows: got a table; expected an integer"),
        ('cell = "0.1"', r"cell: got '0\.1'; expected a number"),
        ("cell = nan", r"cell: got nan; expected a number from 0\.0001 to"),
        ("patch_size = 8.0", r"patch_size: got 8\.0; expected 2 values, each a number"),
        ("patch_size = [8.0]", r"patch_size: got \[8\.0\]; expected 2 values"),
        ("centered = 1", "centered: got 1; expected true or false"),
        ('slope_threshold = "never"', "slope_threshold: got 'never'; expected a number .* or none"),
        ("preset = 3", "preset: got 3; expected a string"),
        ("terrains = 3", "terrains: got 3; expected one or more"),
        ("terrains = []", r"terrains: got \[\]; expected one or more"),
        ('terrains = ["flat"]', r"terrains: got \['flat'\]; expected one or more \[\[terrains\]\]"),
        ("[[terrains]]\nproportion = 1.0", r"terrains\[0\]: terrain: missing; expected a string"),
        (
            '[terrains]\nterrain = "flat"',
            r"terrains: got \{.*\}; expected one or more \[\[terrains\]\]",
        ),
        ("[[terrains]]\nterrain = 3", "terrain: got 3; expected a string"),
        ('[[terrains]]\nterrain = ["flat"]', r"terrain: got \['flat'\]; expected a string"),
        ('[[terrains]]\nterrain = "flat"\nname = 3', "name: got 3; expected a string"),
        ('[[terrains]]\nterrain = "flat"\nproportion = "1"', "proportion: got '1'; expected a num"),
        ('[[terrains]]\nterrain = "flat"\nproportion = [1]', r"proportion: got \[1\]; expected"),
        ('[[terrains]]\nterrain = "flat"\nproportion = true', "proportion: got True; expected a n"),
        (
            '[[terrains]]\nterrain = "gap"\nwidth = "1"',
            r"terrains\[0\]: gap\.width: got '1'; expected a number",
        ),
        ('[[terrains]]\nterrain = "gap"\nwidth = [1, 2, 3]', r"gap\.width: got \[1, 2, 3\]; exp"),
        ('[[terrains]]\nterrain = "gap"\nwidth = [[0], [1]]', r"gap\.width: got \[0\]; expected"),
    ],
)
def test_wrong_type_is_rejected(text, message):
    with pytest.raises(ConfigError, match=message):
        MapConfig.from_toml(text)


def test_preset_with_terrains_is_rejected():
    with pytest.raises(ConfigError, match="preset, terrains: got both; expected one"):
        MapConfig.from_toml('preset = "rough"\n[[terrains]]\nterrain = "flat"')


@pytest.mark.parametrize(
    ("digits", "message"), [(30, "got an integer beyond 64 bits"), (5000, "not a TOML file: ")]
)
@pytest.mark.parametrize(
    "text",
    ["rows = {}", "border = {}", '[[terrains]]\nterrain = "wave"\nnumber = {}'],
    ids=["rows", "border", "number"],
)
def test_integer_beyond_64_bits_is_rejected(text, digits, message):
    with pytest.raises(ConfigError, match=message):
        MapConfig.from_toml(text.format("9" * digits))


@pytest.mark.parametrize("text", ["rows", "rows = ", "rows = 1\nrows = 2", "\0", "# \x07", "[a"])
def test_invalid_toml_is_rejected_on_one_line(text):
    with pytest.raises(ConfigError, match="not a TOML file: ") as caught:
        MapConfig.from_toml(text)
    assert "\n" not in str(caught.value)


def test_key_with_many_dots_is_rejected():
    with pytest.raises(ConfigError, match="not a TOML file: line 1 has 500000 dots"):
        MapConfig.from_toml("a" + ".a" * 500_000 + " = 1")


def test_deep_nesting_is_rejected():
    with pytest.raises(ConfigError, match="not a TOML file"):
        MapConfig.from_toml("rows = " + "[" * 100_000)


def test_load_reads_a_file(tmp_path):
    path = tmp_path / "map.toml"
    path.write_text(MapConfig(rows=3).to_toml())
    assert MapConfig.load(path) == MapConfig(rows=3)
    assert MapConfig.load(str(path)) == MapConfig(rows=3)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"row = 3", "map.toml: config has no key 'row'"),
        (b"rows =", "map.toml: not a TOML file"),
        (b"# \xff", "map.toml: .*can't decode byte 0xff"),
        (b"PK\x03\x04\x00\x00", "map.toml: not a TOML file"),
    ],
)
def test_load_error_names_the_file(tmp_path, data, message):
    path = tmp_path / "map.toml"
    path.write_bytes(data)
    with pytest.raises(ConfigError, match=message):
        MapConfig.load(path)


def test_load_of_missing_file_names_it(tmp_path):
    with pytest.raises(ConfigError, match=r"cannot read .*nowhere\.toml: No such file"):
        MapConfig.load(tmp_path / "nowhere.toml")


def test_load_of_folder_is_rejected(tmp_path):
    with pytest.raises(ConfigError, match=f"cannot read {tmp_path}: "):
        MapConfig.load(tmp_path)


def test_load_rejects_more_than_a_megabyte(tmp_path):
    path = tmp_path / "map.toml"
    path.write_bytes(b"rows = 3\n" + b"\n" * (2**20 - 9))
    assert MapConfig.load(path).rows == 3
    path.write_bytes(b"rows = 3\n" + b"\n" * (2**20 - 8))
    with pytest.raises(ConfigError, match=r"map\.toml: more than 1048576 bytes; expected"):
        MapConfig.load(path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_load_does_not_wait_for_a_pipe(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(ConfigError, match="not a regular file"):
        MapConfig.load(tmp_path / "pipe")
