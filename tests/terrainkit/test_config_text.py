import dataclasses
import os

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terrainkit import MapConfig, SubTerrain, read_config
from terrainkit.config_text import from_toml, to_toml
from terrainkit.errors import ConfigError

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
    "static_friction": 0.8,
    "dynamic_friction": 0.6,
    "restitution": 0.1,
}


@pytest.mark.parametrize("name", [field.name for field in dataclasses.fields(MapConfig)])
def test_every_field_survives_toml(name):
    config = MapConfig(**{name: NOT_THE_DEFAULT[name]})
    assert config != MapConfig()
    assert from_toml(to_toml(config)) == config


def test_a_mode_with_its_one_terrain_survives_toml():
    config = MapConfig(mode="selected", terrains=(FLAT,), selected_difficulty=0.4)
    assert from_toml(to_toml(config)) == config


def test_a_mix_of_ones_own_is_written_without_a_preset():
    config = MapConfig(preset="rough", terrains=(FLAT,))
    assert "preset" not in to_toml(config)
    assert from_toml(to_toml(config)) == config


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
def test_numpys_numbers_survive_toml(terrain, parameters):
    config = MapConfig(terrains=(SubTerrain(terrain=terrain, parameters=parameters),))
    assert from_toml(to_toml(config)) == config


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
def test_any_config_survives_toml(rows, seed, threshold, friction, difficulties, name, width):
    config = MapConfig(
        rows=rows,
        seed=seed,
        slope_threshold=threshold,
        static_friction=friction,
        random_difficulties=tuple(difficulties),
        terrains=(SubTerrain(terrain="gap", name=name, parameters={"width": width}),),
    )
    assert from_toml(to_toml(config)) == config


def test_no_walls_are_written_as_a_word():
    assert 'slope_threshold = "none"' in to_toml(MapConfig(slope_threshold=None))


def test_what_a_file_leaves_out_has_its_default():
    assert from_toml("") == MapConfig()


def test_a_file_written_by_hand():
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
    assert from_toml(text) == MapConfig(
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
        ("row = 3", "config has no key 'row'; it has: rows, cols, patch_size, cell, "),
        ("[map]\nrows = 3", "config has no key 'map'; it has: rows, "),
        ('[[terrains]]\nterrain = "lava"', "no terrain 'lava'; there are: flat, gap, "),
        (
            '[[terrains]]\nterrain = "gap"\nwidht = 1.0',
            "gap has no parameter 'widht'; it has: width, depth, platform",
        ),
    ],
)
def test_an_unknown_name_lists_the_known_ones(text, message):
    with pytest.raises(ConfigError, match=message):
        from_toml(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("rows = 3.0", r"rows is 3\.0; wanted a whole number"),
        ('rows = "3"', "rows is '3'; wanted a whole number"),
        ("rows = true", "rows is True; wanted a whole number"),
        ("rows = 2000-01-01", r"rows is datetime\.date\(2000, 1, 1\); wanted a whole number"),
        ("rows = [3]", r"rows is \[3\]; wanted a whole number"),
        ("rows = {}", r"rows is \{\}; wanted a whole number"),
        ('cell = "0.1"', r"cell is '0\.1'; wanted a number"),
        ("cell = nan", r"cell is nan; wanted 0\.0001 to"),
        ("patch_size = 8.0", r"patch_size is 8\.0; wanted a list"),
        ("patch_size = [8.0]", "patch_size has 1 values; wanted 2"),
        ("centered = 1", "centered is 1; wanted true or false"),
        ('slope_threshold = "never"', "slope_threshold is 'never'; wanted a number"),
        ("preset = 3", "preset is 3; wanted a text"),
        ("terrains = 3", "terrains is 3; wanted one or more"),
        ("terrains = []", r"terrains is \[\]; wanted one or more"),
        ('terrains = ["flat"]', "'flat' in terrains; wanted a table with a key 'terrain'"),
        ("[[terrains]]\nproportion = 1.0", "in terrains; wanted a table with a key 'terrain'"),
        (
            '[terrains]\nterrain = "flat"',
            r"terrains is \{.*\}; wanted one or more \[\[terrains\]\]",
        ),
        ("[[terrains]]\nterrain = 3", "terrain is 3; wanted a text"),
        ('[[terrains]]\nterrain = ["flat"]', r"terrain is \['flat'\]; wanted a text"),
        ('[[terrains]]\nterrain = "flat"\nname = 3', "name is 3; wanted a text"),
        ('[[terrains]]\nterrain = "flat"\nproportion = "1"', "proportion is '1'; wanted a number"),
        (
            '[[terrains]]\nterrain = "flat"\nproportion = [1]',
            r"proportion is \[1\]; wanted a number",
        ),
        (
            '[[terrains]]\nterrain = "flat"\nproportion = true',
            "proportion is True; wanted a number",
        ),
        ('[[terrains]]\nterrain = "gap"\nwidth = "1"', "gap: width is '1'; wanted a number"),
        ('[[terrains]]\nterrain = "gap"\nwidth = [1, 2, 3]', r"gap: width is \(1, 2, 3\); wanted"),
        (
            '[[terrains]]\nterrain = "gap"\nwidth = [[0], [1]]',
            r"gap: width is \(0,\); wanted a number",
        ),
    ],
)
def test_a_value_of_the_wrong_kind_is_refused_by_name(text, message):
    with pytest.raises(ConfigError, match=message):
        from_toml(text)


def test_preset_and_terrains_together_are_refused():
    with pytest.raises(ConfigError, match="both preset and terrains; wanted one of them"):
        from_toml('preset = "rough"\n[[terrains]]\nterrain = "flat"')


@pytest.mark.parametrize(
    ("digits", "message"), [(30, "a whole number beyond 64 bits"), (5000, "not a TOML file: ")]
)
@pytest.mark.parametrize(
    "text",
    ["rows = {}", "border = {}", '[[terrains]]\nterrain = "wave"\nnumber = {}'],
    ids=["rows", "border", "number"],
)
def test_a_number_of_many_digits_is_refused(text, digits, message):
    with pytest.raises(ConfigError, match=message):
        from_toml(text.format("9" * digits))


@pytest.mark.parametrize("text", ["rows", "rows = ", "rows = 1\nrows = 2", "\0", "# \x07", "[a"])
def test_what_is_not_toml_is_said_to_be_none_in_one_line(text):
    with pytest.raises(ConfigError, match="not a TOML file: ") as caught:
        from_toml(text)
    assert "\n" not in str(caught.value)


def test_a_key_of_many_dots_is_refused_at_once():
    with pytest.raises(ConfigError, match="not a TOML file: line 1 has 500000 dots"):
        from_toml("a" + ".a" * 500_000 + " = 1")


def test_deep_nesting_is_refused():
    with pytest.raises(ConfigError, match="not a TOML file"):
        from_toml("rows = " + "[" * 100_000)


def test_a_config_is_read_from_a_file(tmp_path):
    path = tmp_path / "map.toml"
    path.write_text(to_toml(MapConfig(rows=3)))
    assert read_config(path) == MapConfig(rows=3)
    assert read_config(str(path)) == MapConfig(rows=3)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"row = 3", "map.toml: config has no key 'row'"),
        (b"rows =", "map.toml: not a TOML file"),
        (b"# \xff", "map.toml: .*can't decode byte 0xff"),
        (b"PK\x03\x04\x00\x00", "map.toml: not a TOML file"),
    ],
)
def test_an_error_in_a_file_names_the_file(tmp_path, data, message):
    path = tmp_path / "map.toml"
    path.write_bytes(data)
    with pytest.raises(ConfigError, match=message):
        read_config(path)


def test_a_missing_file_is_an_error_that_names_it(tmp_path):
    with pytest.raises(ConfigError, match=r"cannot read .*nowhere\.toml: No such file"):
        read_config(tmp_path / "nowhere.toml")


def test_a_folder_is_an_error_that_names_it(tmp_path):
    with pytest.raises(ConfigError, match=f"cannot read {tmp_path}: "):
        read_config(tmp_path)


def test_a_file_of_a_megabyte_is_read_and_one_byte_more_is_not(tmp_path):
    path = tmp_path / "map.toml"
    path.write_bytes(b"rows = 3\n" + b"\n" * (2**20 - 9))
    assert read_config(path).rows == 3
    path.write_bytes(b"rows = 3\n" + b"\n" * (2**20 - 8))
    with pytest.raises(ConfigError, match=r"map\.toml: over 1048576 bytes; wanted a TOML file"):
        read_config(path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(ConfigError, match="not a plain file"):
        read_config(tmp_path / "pipe")
