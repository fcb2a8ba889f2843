import math
import os
import re
import tomllib
from dataclasses import fields
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terrainkit.errors import ConfigError
from terrainkit_robots.spec.robot_spec import JOINT_TABLES, Provenance, RobotSpec, Twin, unit_of
from terrainkit_robots.spec.spec_file import from_toml, read_spec, to_toml

NAMES = st.text(st.characters(codec="utf-8", exclude_characters="\0"), min_size=1, max_size=12)
NUMBERS = st.floats(allow_nan=False, allow_infinity=False)
POSITIVE = NUMBERS.map(abs)
PAIRS = st.tuples(NUMBERS, NUMBERS).map(sorted).map(tuple)
LISTS = st.lists(NAMES, unique=True, max_size=4).map(tuple)
ORIGINS = st.builds(
    Provenance,
    origin=st.sampled_from(["declared", "measured", "solved", "suggested"]),
    reason=st.text(st.characters(codec="utf-8"), max_size=20),
)


def table(values):
    return st.dictionaries(NAMES, values, max_size=4)


def strategy(field):
    """Return what a field of a spec may hold."""
    if field.name in ("default_pose",):
        return table(NUMBERS)
    if field.name == "effort":
        return table(POSITIVE.filter(bool))
    if field.name in JOINT_TABLES:
        return table(POSITIVE)
    by_name = {
        "floating": st.booleans(),
        "soft_limits": table(PAIRS),
        "reset_range": st.tuples(POSITIVE, POSITIVE).map(sorted).map(tuple),
        "mirror": table(st.builds(Twin, joint=NAMES, sign=st.sampled_from([-1, 1]))),
        "provenance": st.dictionaries(
            st.sampled_from([f.name for f in fields(RobotSpec)])
            | NAMES.map(lambda name: f"effort.{name}"),
            ORIGINS,
            max_size=4,
        ),
    }
    by_type = {str: NAMES, tuple[str, ...]: LISTS, float | None: st.none() | POSITIVE}
    return by_name[field.name] if field.name in by_name else by_type[field.type]


SPECS = st.fixed_dictionaries({field.name: strategy(field) for field in fields(RobotSpec)}).map(
    lambda values: RobotSpec(**values)
)


@given(SPECS)
@settings(max_examples=25, deadline=None)
def test_any_spec_is_read_as_it_was_written(spec):
    text = to_toml(spec)
    assert from_toml(text) == spec
    assert to_toml(from_toml(text)) == text


@pytest.fixture
def text(spec):
    """Return the text of a small spec."""
    return to_toml(spec())


def test_a_number_has_its_unit_and_origin_beside_it(spec):
    made = spec(
        spawn_height=0.3,
        provenance={
            "spawn_height": Provenance(origin="solved", reason="1 cm\nabove"),
            "effort": Provenance(origin="declared"),
            "effort.b": Provenance(origin="suggested", reason="as the twin"),
        },
    )
    lines = to_toml(made).splitlines()
    assert "spawn_height = 0.3  # m; solved: 1 cm above" in lines
    assert "reset_range = [0.5, 1.5]  # no unit" in lines
    assert "[effort]  # N m or N; declared" in lines
    assert "a = 1.0" in lines
    assert "b = 2.0  # suggested: as the twin" in lines
    assert '"effort.b" = { origin = "suggested", reason = "as the twin" }' in lines
    assert 'effort = { origin = "declared" }' in lines


def test_every_key_is_explained_and_every_number_has_a_unit(spec):
    made = spec(**{f.name: 1.0 for f in fields(RobotSpec) if f.type == float | None})
    lines = to_toml(made).splitlines()
    for field in fields(RobotSpec):
        (at,) = [k for k, line in enumerate(lines) if re.match(rf"\[?{field.name}\b", line)]
        assert lines[at - 1].startswith("# "), field.name
        assert ("  # " in lines[at]) == bool(unit_of(field.name)), field.name


def test_what_a_robot_has_not_is_left_out(text):
    assert "spawn_height" not in tomllib.loads(text)
    assert from_toml(text).spawn_height is None


def test_a_name_cannot_break_out_of_the_head(spec):
    made = spec(name='x\nformat_version = 2\n"')
    assert from_toml(to_toml(made)) == made


def test_tables_may_be_written_on_one_line_and_numbers_whole():
    text = """
        format_version = 1
        name = "r"
        urdf = "r.urdf"
        mjcf = "r.xml"
        floating = false
        joint_order = ["a.b"]
        base = "trunk"
        default_pose = { ".*" = 0 }
        stiffness = { "a.b" = 20 }
        damping = { ".*" = 1 }
        effort = { ".*" = 20 }
        velocity = { ".*" = 20 }
        armature = { ".*" = 0 }
        action_scale = { ".*" = 1 }
        soft_limits = {}
    """
    spec = from_toml(text)
    assert spec.per_joint("stiffness") == {"a.b": 20.0}
    assert from_toml(to_toml(spec)) == spec


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("format_version = 1", "", "format_version is missing; wanted 1"),
        ("format_version = 1", "format_version = 2", "format_version is 2; wanted 1"),
        ("format_version = 1", "format_version = true", "format_version is True; wanted 1"),
        ('base = "trunk"', "", "the key base is missing"),
        ("[effort]", "[efort]", "the spec has no key 'efort'; did you mean effort?; it has: name"),
        ("[effort]", "[x.y]", "the spec has no key 'x'; it has: name, urdf, mjcf"),
        ('base = "trunk"', "base = 3", "base is 3; wanted a text"),
        ('base = "trunk"', "base = 2020-01-01", "base is datetime.date(2020, 1, 1); wanted a text"),
        ('base = "trunk"', "base = nan", "base is nan; wanted a text"),
        ('base = "trunk"', "base", "not a TOML file: Expected '=' after a key"),
        ('base = "trunk"', "base = 'a'\nbase = 'b'", "not a TOML file: Cannot overwrite a value"),
        ("\n[mirror]", "\n[[mirror]]", "mirror is [{}]; wanted a table"),
        ("[mirror]", "[mirror]\na = 3", "mirror.a is 3; wanted a table with joint and sign"),
        ("[mirror]", "[mirror]\na = { joint = 'b' }", "mirror.a lacks sign; wanted joint and sign"),
        ("[mirror]", "[mirror]\na = { joint = 'b', sign = 2 }", "mirror.a.sign is 2; wanted 1 or"),
        ("[mirror]", "[mirror]\na.b = { joint = 'b', sign = 1 }", "a name with a dot goes in quot"),
        (
            "\n[provenance]",
            "\n[provenance]\neffort = { origin = 'me' }",
            "provenance.effort.origin is",
        ),
        (
            "\n[provenance]",
            "\n[provenance]\nx = { origin = 'solved' }",
            "provenance has 'x'; wanted",
        ),
        (
            "\n[provenance]",
            "\n[provenance]\neffort = { orgin = 'solved' }",
            "provenance.effort has 'or",
        ),
        (
            "[effort]  # N m or N\na = 1.0",
            "[effort]\na = -1",
            "effort.a is -1; wanted more than 0",
        ),
        (
            "[effort]  # N m or N\na = 1.0",
            "[effort]\na = inf",
            "effort.a is inf; wanted more",
        ),
        ("[effort]  # N m or N\na = 1.0", "[effort]\na = 1e999", "effort.a is inf; wanted more"),
        (
            "[effort]  # N m or N\na = 1.0",
            "[effort]\na.c = 1.0",
            "effort.a is a table; wanted more",
        ),
        (
            "[effort]  # N m or N\na = 1.0",
            f"[effort]\na = {'9' * 30}",
            "effort.a is a whole number beyond 64 bits",
        ),
    ],
)
def test_an_error_names_the_key(text, old, new, message):
    assert old in text
    with pytest.raises(ConfigError, match=re.escape(message)) as caught:
        from_toml(text.replace(old, new, 1))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "a = " + "[" * 100_000,
        "a = " + "9" * 100_000,
        ".".join("a" * 200_000) + " = 1",
        "format_version = 1\n" + "x" * 900_000 + " = 1",
        f"format_version = 1\nname = '{'x' * 100}'\n" + "stiffness = 'y'\n" * 2,
        "\0",
    ],
)
def test_bad_text_is_one_short_line(text):
    with pytest.raises(ConfigError) as caught:
        from_toml(text)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) <= 500


def test_a_file_is_read_and_its_errors_name_it(tmp_path, spec):
    path = tmp_path / "robot.toml"
    path.write_text(to_toml(spec(name="Käfer")), encoding="utf-8")
    assert read_spec(path).name == "Käfer"
    path.write_text("format_version = 3")
    with pytest.raises(ConfigError, match=re.escape(f"{path}: format_version is 3; wanted 1")):
        read_spec(path)
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(ConfigError, match=re.escape(f"{path}: 'utf-8' codec")):
        read_spec(path)
    path.write_bytes(b"#" * ((1 << 20) + 1))
    with pytest.raises(ConfigError, match=r"robot\.toml: over 1048576 bytes"):
        read_spec(path)
    with pytest.raises(ConfigError, match=r"cannot read .*: No such file or directory"):
        read_spec(tmp_path / "none.toml")
    with pytest.raises(ConfigError, match="cannot read"):
        read_spec(tmp_path / "a\0b")


def test_numbers_are_exact(spec):
    made = spec(spawn_height=math.nextafter(0.1, 1), armature={"a": 5e-324, "b": 1e300})
    assert from_toml(to_toml(made)) == made


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes on this system")
def test_only_a_plain_file_is_a_spec(tmp_path):
    pipe = tmp_path / "robot.toml"
    os.mkfifo(pipe)
    with pytest.raises(ConfigError, match=r"cannot read .*robot.toml: is a pipe, not a file"):
        read_spec(pipe)
    with pytest.raises(ConfigError, match="is a folder, not a file"):
        read_spec(tmp_path)
    with pytest.raises(ConfigError, match="cannot read /dev/zero: is a device, not a file"):
        read_spec(Path("/dev/zero"))


def test_a_key_of_many_dots_is_refused_at_once():
    with pytest.raises(ConfigError, match="500000 dots"):
        from_toml("a" + ".a" * 500_000 + " = 1")
