import ast
import itertools

import pytest

from terrainkit.errors import ConfigError
from terrainkit_robots.onboarding.frameworks.source import (
    assign,
    assign_sum,
    comment,
    docstring,
    literal,
    number,
    spread,
)


def test_literals_are_what_they_stand_for():
    letters = ["a", '"', "'", "\\", "\n", "\u202e", "\u00e9", "{"]
    for text in map("".join, itertools.product(letters, repeat=4)):
        assert ast.literal_eval(literal(text)) == text
        assert "\n" not in literal(text)


@pytest.mark.parametrize(
    ("text", "source"),
    [("a", '"a"'), ("it's", '"it\'s"'), ('say "x"', "'say \"x\"'"), ("'\"", '"\'\\""')],
)
def test_literals_are_quoted_as_ruff_does(text, source):
    assert literal(text) == source


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
def test_numbers_are_floats_of_six_digits(value, source):
    assert number(value) == source
    assert isinstance(ast.literal_eval(source), float)


@pytest.mark.parametrize("value", [float("inf"), float("nan")])
def test_numbers_that_are_none_are_errors(value):
    with pytest.raises(ConfigError, match="no configuration can hold"):
        number(value)


def test_collections_are_on_one_line_if_they_fit():
    assert spread("a = ", []) == ["a = []"]
    assert spread("a = ", ["1", "2"]) == ["a = [1, 2]"]
    assert spread("a=", ["1"], "()", tail=",") == ["a=(1,),"]
    assert spread("a = ", ['"k": 1'], "{}") == ["a = {", '    "k": 1,', "}"]
    long = ["1" * 41, "2" * 40]
    assert spread("a = ", long, depth=1) == ["a = [", *(f"    {item}," for item in long), "]"]


def test_assignments_are_broken_where_that_helps():
    assert assign("name", '"x"') == ['name = "x"']
    value = '"' + "x" * 82 + '"'
    assert assign("name", value) == ["name = (", f"    {value}", ")"]
    assert assign("name", value, depth=1) == [f"name = {value}"]
    assert assign_sum("a", "b", "+", value) == ["a = (", "    b", f"    + {value}", ")"]


def test_comments_stay_comments():
    assert comment("") == []
    lines = comment("x\nraise SystemExit\r\x0c\u2028y " + "word " * 30)
    assert all(line.startswith("# ") and len(line) <= 88 for line in lines)
    assert compile("\n".join(lines), "comment", "exec").co_names == ()


def test_docstrings_stay_docstrings():
    lines = docstring(['a """ title \\', "    code(\n        1\n    )"])
    (statement,) = ast.parse("\n".join(lines)).body
    assert ast.literal_eval(statement.value) == "a ''' title \\\n\n    code(\n        1\n    )\n"
