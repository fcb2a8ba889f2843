import ast
import itertools

import pytest

from terrainkit.errors import ConfigError
from terrainkit_robots.onboarding.frameworks.source import (
    assignment,
    comment,
    docstring,
    float_literal,
    format_collection,
    string_literal,
)


def test_string_literal_evaluates_to_text():
    letters = ["a", '"', "'", "\\", "\n", "\u202e", "\u00e9", "{"]
    for text in map("".join, itertools.product(letters, repeat=4)):
        assert ast.literal_eval(string_literal(text)) == text
        assert "\n" not in string_literal(text)


@pytest.mark.parametrize(
    ("text", "source"),
    [("a", '"a"'), ("it's", '"it\'s"'), ('say "x"', "'say \"x\"'"), ("'\"", '"\'\\""')],
)
def test_string_literal_quotes_like_ruff(text, source):
    assert string_literal(text) == source


@pytest.mark.parametrize(
    ("value", "source"),
    [
        (0, "0.0"),
        (-0.0, "0.0"),
        (20, "20.0"),
        (0.1 + 0.2, "0.3"),
        (-1.8000000001, "-1.8"),
        (1e-7, "1e-07"),
        (1e308, "1e+308"),
        (123456.0, "123456.0"),
    ],
)
def test_float_literal_has_six_digits(value, source):
    assert float_literal(value) == source
    assert isinstance(ast.literal_eval(source), float)


def test_float_literal_rejects_infinite_numbers():
    for value in (float("inf"), float("nan")):
        with pytest.raises(ConfigError, match="expected a finite number"):
            float_literal(value)


def test_format_collection():
    assert format_collection("a = ", []) == ["a = []"]
    assert format_collection("a = ", ["1", "2"]) == ["a = [1, 2]"]
    assert format_collection("a=", ["1"], "()", suffix=",") == ["a=(1,),"]
    assert format_collection("a = ", ['"k": 1'], "{}") == ["a = {", '    "k": 1,', "}"]
    long = ["1" * 41, "2" * 40]
    assert format_collection("a = ", long, depth=1) == [
        "a = [",
        *(f"    {item}," for item in long),
        "]",
    ]


def test_assignment_is_wrapped():
    assert assignment("name", '"x"') == ['name = "x"']
    value = '"' + "x" * 82 + '"'
    assert assignment("name", value) == ["name = (", f"    {value}", ")"]
    assert assignment("name", value, depth=1) == [f"name = {value}"]
    assert assignment("a", "b", f"+ {value}") == ["a = (", "    b", f"    + {value}", ")"]


def test_comment_prevents_code_injection():
    assert comment("") == []
    lines = comment("x\nraise SystemExit\r\x0c\u2028y " + "word " * 30)
    assert all(line.startswith("# ") and len(line) <= 88 for line in lines)
    assert compile("\n".join(lines), "comment", "exec").co_names == ()


def test_docstring_prevents_code_injection():
    lines = docstring(['a """ title \\', "    code(\n        1\n    )"])
    (statement,) = ast.parse("\n".join(lines)).body
    assert ast.literal_eval(statement.value) == "a ''' title \\\n\n    code(\n        1\n    )\n"
