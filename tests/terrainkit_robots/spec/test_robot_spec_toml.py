import math
import os
import re
from dataclasses import fields

import pytest

from terrainkit.errors import ConfigError
from terrainkit_robots.spec.robot_spec import (
    ClosedLoop,
    MirrorJoint,
    Provenance,
    RobotSpec,
    unit_of,
)
from tests.tables import read_table

NAMES = ["a", "Käfer", "a.b", '"', "\\", 'x\nversion = 2\n"', "#", "\u2028", " ", "\x7f"]
NAMES += ["😀", "[a]"]
NUMBERS = (0.0, 5e-324, math.nextafter(0.1, 1), 1.0, 1e8, 1e30)
SOLVED = Provenance(origin="solved", reason='1 cm\nabove # "x"')


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("number", NUMBERS)
def test_toml_round_trip(spec, name, number):
    made = spec(
        **dict.fromkeys(("name", "urdf", "mjcf", "base"), name),
        **dict.fromkeys(
            ("joint_order", "feet", "shanks", "thighs", "termination_contacts"), (name,)
        ),
        **{table: {name: number, ".*": 1} for table in ("stiffness", "damping", "armature")},
        **dict.fromkeys(("spawn_height", "leg_length"), number or None),
        default_pose={name: -number},
        soft_limits={name: (-number, number)},
        reset_range=(number, number),
        floating=False,
        mirror={name: MirrorJoint(joint=name, sign=-1)},
        provenance={"effort": SOLVED, f"effort.{name}": SOLVED},
    )
    text = made.to_toml()
    assert RobotSpec.from_toml(text) == made
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
    loop = ClosedLoop(links=("a", "b"), anchor=(0.0, 0.0, 0.0))
    made = spec(loops=(loop,), **{f.name: 1.0 for f in fields(RobotSpec) if f.default is None})
    lines = made.to_toml().splitlines()
    for field in fields(RobotSpec):
        (at,) = [k for k, line in enumerate(lines) if re.match(rf"\[*{field.name}\b", line)]
        assert lines[at - 1].startswith("# "), field.name
        assert ("  # " in lines[at]) == bool(unit_of(field.name)), field.name


def test_inline_tables_and_integers_are_read(text):
    old, new = "[stiffness]  # N m/rad or N/m\na = 1.0\nb = 2.0\n", 'stiffness = { "[ab]" = 20 }\n'
    assert old in text
    spec = RobotSpec.from_toml(new + text.replace(old, ""))
    assert spec.per_joint("stiffness") == {"a": 20.0, "b": 20.0}
    assert RobotSpec.from_toml(spec.to_toml()) == spec


EFFORT = "[effort]  # N m or N\na = 1.0"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        *read_table(__file__, "error_names_the_key"),
        (EFFORT, f"[effort]\na = {'9' * 30}", "effort.a: got an integer beyond 64 bits"),
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
        "a" + ".a" * 500_000 + " = 1",
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


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"format_version = 3", "{}: format_version: got 3; expected 1"),
        (b"\xff\xfe", "{}: 'utf-8' codec"),
        (b"#" * ((1 << 20) + 1), "{}: more than 1048576 bytes"),
        (b"#" * (1 << 20), "{}: format_version: got nothing"),
    ],
)
def test_load_error_names_the_file(tmp_path, data, message):
    path = tmp_path / "robot.toml"
    path.write_bytes(data)
    with pytest.raises(ConfigError, match=re.escape(message.format(path))):
        RobotSpec.load(path)


@pytest.mark.parametrize(("name", "message"), read_table(__file__, "load_rejects_other"))
def test_load_rejects_other_than_regular_files(tmp_path, name, message):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(ConfigError, match=message):
        RobotSpec.load(tmp_path / name)
