import time

import pytest

from terrainkit.errors import ConfigError
from terrainkit.toml_text import parse_toml


def test_parse_toml_returns_a_table():
    assert parse_toml("a = 1\nb.c = 2.5\n[d]\ne = ['x', 0.5]") == {
        "a": 1,
        "b": {"c": 2.5},
        "d": {"e": ["x", 0.5]},
    }


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a", "not a TOML file: Expected '=' after a key"),
        ("a = 1\na = 2", "not a TOML file: Cannot overwrite a value"),
        ("a = " + "9" * 5000, "not a TOML file: "),
        ("a = " + "[" * 100_000, "not a TOML file: nested too deeply"),
        ("a" + ".a" * 500_000 + " = 1", "not a TOML file: line 1 has 500000 dots"),
        ("x = 1\n[" + "a." * 500_000 + "a]", "not a TOML file: line 2 has 500000 dots"),
        # What Python calls the end of a line is none to TOML.
        ("'\\u2028'" + ".'\\u2028'.a" * 90_000 + " = 1", "not a TOML file: line 1 has 180000 dots"),
        (("a" + ".a" * 1_000 + "\n") * 400, "not a TOML file: line 1 has 1000 dots"),
    ],
)
def test_parse_toml_rejects_hostile_text_quickly(text, message):
    start = time.perf_counter()
    with pytest.raises(ConfigError) as caught:
        parse_toml(text)
    assert str(caught.value).startswith(message)
    assert time.perf_counter() - start < 1


def test_parse_toml_accepts_usual_dots():
    numbers = [k + 0.5 for k in range(3000)]
    assert parse_toml(f"a = {numbers}")["a"] == numbers
    lines = "".join(f"a{k}.b.c = 'x...'\n" for k in range(20_000))
    assert len(parse_toml(lines)) == 20_000
