import math
import os
import re
import tomllib
from dataclasses import fields
from pathlib import Path
from typing import get_origin

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terrainkit.errors import ConfigError
from terrainkit.settings.type_hint import parse_hint
from terrainkit_robots.spec.robot_spec import (
    JOINT_TABLES,
    MirrorJoint,
    Provenance,
    RobotSpec,
    unit_of,
)

NAMES = st.text(st.characters(codec="utf-8", exclude_characters="\0"), min_size=1, max_size=12)
NUMBERS = st.floats(-1e30, 1e30)
NON_NEGATIVE = NUMBERS.map(abs)
POSITIVE = st.floats(1e-12, 1e30)
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
        return table(POSITIVE)
    if field.name in JOINT_TABLES:
        return table(NON_NEGATIVE)
    by_name = {
        "floating": st.booleans(),
        "soft_limits": table(PAIRS),
        "reset_range": st.tuples(NON_NEGATIVE, NON_NEGATIVE).map(sorted).map(tuple),
        "mirror": table(st.builds(MirrorJoint, joint=NAMES, sign=st.sampled_from([-1, 1]))),
        "provenance": st.dictionaries(
            st.sampled_from([f.name for f in fields(RobotSpec)])
            | NAMES.map(lambda name: f"effort.{name}"),
            ORIGINS,
            max_size=4,
        ),
    }
    kind = parse_hint(field.type).kind
    by_type = {str: NAMES, tuple: LISTS, float: st.none() | POSITIVE}
    return by_name[field.name] if field.name in by_name else by_type[get_origin(kind) or kind]


SPECS = st.fixed_dictionaries({field.name: strategy(field) for field in fields(RobotSpec)}).map(
    lambda values: RobotSpec(**values)
)


@given(SPECS)
@settings(max_examples=25, deadline=None)
def test_toml_round_trip(spec):
    text = spec.to_toml()
    assert RobotSpec.from_toml(text) == spec
    assert RobotSpec.from_toml(text).to_toml() == text


@pytest.fixture
def text(spec):
    """Return the text of a small spec."""
    return spec().to_toml()


def test_comments_state_unit_and_origin(spec):
    made = spec(
        spawn_height=0.3,
        provenance={
            "spawn_height": Provenance(origin="solved", reason="1 cm\nabove"),
            "effort": Provenance(origin="declared"),
            "effort.b": Provenance(origin="suggested", reason="as the twin"),
        },
    )
    lines = made.to_toml().splitlines()
    assert "spawn_height = 0.3  # m; solved: 1 cm above" in lines
    assert "reset_range = [0.5, 1.5]  # no unit" in lines
    assert "[effort]  # N m or N; declared" in lines
    assert "a = 1.0" in lines
    assert "b = 2.0  # suggested: as the twin" in lines
    assert '"effort.b" = { origin = "suggested", reason = "as the twin" }' in lines
    assert 'effort = { origin = "declared" }' in lines


def test_every_key_has_a_comment(spec):
    made = spec(**{f.name: 1.0 for f in fields(RobotSpec) if f.default is None})
    lines = made.to_toml().splitlines()
    for field in fields(RobotSpec):
        (at,) = [k for k, line in enumerate(lines) if re.match(rf"\[?{field.name}\b", line)]
        assert lines[at - 1].startswith("# "), field.name
        assert ("  # " in lines[at]) == bool(unit_of(field.name)), field.name


def test_none_is_left_out(text):
    assert "spawn_height" not in tomllib.loads(text)
    assert RobotSpec.from_toml(text).spawn_height is None


def test_name_cannot_inject_lines(spec):
    made = spec(name='x\nformat_version = 2\n"')
    assert RobotSpec.from_toml(made.to_toml()) == made


def test_inline_tables_and_integers_are_read():
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
    spec = RobotSpec.from_toml(text)
    assert spec.per_joint("stiffness") == {"a.b": 20.0}
    assert RobotSpec.from_toml(spec.to_toml()) == spec


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("format_version = 1", "", "format_version: got nothing; expected 1"),
        ("format_version = 1", "format_version = 2", "format_version: got 2; expected 1"),
        ("format_version = 1", "format_version = true", "format_version: got True; expected 1"),
        ('base = "trunk"', "", "base: missing; expected a non-empty string"),
        ("[effort]", "[efort]", "config has no key 'efort'; did you mean 'effort'? It has: name"),
        ("[effort]", "[x.y]", "config has no key 'x'; it has: name, urdf, mjcf"),
        ('base = "trunk"', "base = 3", "base: got 3; expected a non-empty"),
        ('base = "trunk"', "base = 2020-01-01", "base: got datetime.date(2020, 1, 1); expected"),
        ('base = "trunk"', "base = nan", "base: got nan; expected a non-empty"),
        ('base = "trunk"', "base", "not a TOML file: Expected '=' after a key"),
        ('base = "trunk"', "base = 'a'\nbase = 'b'", "not a TOML file: Cannot overwrite a value"),
        ("\n[mirror]", "\n[[mirror]]", "mirror: got [a table]; expected a table"),
        ("[mirror]", "[mirror]\na = 3", "mirror.a: got 3; expected a table (MirrorJoint)"),
        (
            "[mirror]",
            "[mirror]\na = { joint = 'b' }",
            "mirror.a.sign: missing; expected",
        ),
        (
            "[mirror]",
            "[mirror]\na = { joint = 'b', sign = 2 }",
            "mirror.a.sign: got 2;",
        ),
        (
            "[mirror]",
            "[mirror]\na.b = { joint = 'b', sign = 1 }",
            "(a key with a dot needs quotes)",
        ),
        (
            "\n[provenance]",
            "\n[provenance]\neffort = { origin = 'me' }",
            "provenance.effort.origin: got",
        ),
        (
            "\n[provenance]",
            "\n[provenance]\nx = { origin = 'solved' }",
            "provenance: got 'x'; expected",
        ),
        (
            "\n[provenance]",
            "\n[provenance]\neffort = { orgin = 'solved' }",
            "provenance.effort has no key 'or",
        ),
        (
            "[effort]  # N m or N\na = 1.0",
            "[effort]\na = -1",
            "effort.a: got -1; expected a number > 0",
        ),
        (
            "[effort]  # N m or N\na = 1.0",
            "[effort]\na = inf",
            "effort.a: got inf; expected",
        ),
        ("[effort]  # N m or N\na = 1.0", "[effort]\na = 1e999", "effort.a: got inf; expected"),
        (
            "[effort]  # N m or N\na = 1.0",
            "[effort]\na.c = 1.0",
            "effort.a: got a table; expected a number",
        ),
        (
            "[effort]  # N m or N\na = 1.0",
            f"[effort]\na = {'9' * 30}",
            "effort.a: got an integer beyond 64 bits",
        ),
    ],
)
def test_error_names_the_key(text, old, new, message):
    assert old in text
    with pytest.raises(ConfigError, match=re.escape(message)) as caught:
        RobotSpec.from_toml(text.replace(old, new, 1))
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
def test_error_is_one_short_line(text):
    with pytest.raises(ConfigError) as caught:
        RobotSpec.from_toml(text)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) <= 500


def test_load_error_names_the_file(tmp_path, spec):
    path = tmp_path / "robot.toml"
    path.write_text(spec(name="Käfer").to_toml(), encoding="utf-8")
    assert RobotSpec.load(path).name == "Käfer"
    path.write_text("format_version = 3")
    with pytest.raises(ConfigError, match=re.escape(f"{path}: format_version: got 3; expected 1")):
        RobotSpec.load(path)
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(ConfigError, match=re.escape(f"{path}: 'utf-8' codec")):
        RobotSpec.load(path)
    path.write_bytes(b"#" * ((1 << 20) + 1))
    with pytest.raises(ConfigError, match=r"robot\.toml: more than 1048576 bytes"):
        RobotSpec.load(path)
    with pytest.raises(ConfigError, match=r"cannot read .*: No such file or directory"):
        RobotSpec.load(tmp_path / "none.toml")
    with pytest.raises(ConfigError, match="cannot read"):
        RobotSpec.load(tmp_path / "a\0b")


def test_toml_numbers_are_exact(spec):
    made = spec(spawn_height=math.nextafter(0.1, 1), armature={"a": 5e-324, "b": 1e8})
    assert RobotSpec.from_toml(made.to_toml()) == made


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes on this system")
def test_load_rejects_other_than_regular_files(tmp_path):
    pipe = tmp_path / "robot.toml"
    os.mkfifo(pipe)
    with pytest.raises(ConfigError, match=r"cannot read .*robot.toml: not a regular file"):
        RobotSpec.load(pipe)
    with pytest.raises(ConfigError, match="not a regular file"):
        RobotSpec.load(tmp_path)
    with pytest.raises(ConfigError, match="cannot read /dev/zero: not a regular file"):
        RobotSpec.load(Path("/dev/zero"))


def test_key_with_many_dots_is_rejected():
    with pytest.raises(ConfigError, match="500000 dots"):
        RobotSpec.from_toml("a" + ".a" * 500_000 + " = 1")
