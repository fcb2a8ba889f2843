import re

import pytest

from terrainkit.errors import ConfigError
from terrainkit_robots.lint import rule as module
from terrainkit_robots.lint.rule import FAMILIES, IMPORTANCE, Violation, get_rule, rule, rules

PAGE = """A mass is negative.

    Simulators divide
    by it.

    And it is not physical.

    Fix:
        Write the mass
        of the part.

    Source:
        A book, chapter 3.
    """


@pytest.fixture
def empty(monkeypatch):
    """Return an empty registry."""
    registry = {}
    monkeypatch.setattr(module, "_RULES", registry)
    return registry


def check(text=PAGE):
    def negative(robot):
        yield Violation(subject="a", source=robot.model.source, message="b")

    negative.__doc__ = text
    return negative


def test_rule_page_is_parsed(empty):
    rule("INR099", "negative-mass", "error", fixes="safe", needs=("legs",))(check())
    made = empty["INR099"]
    assert (made.code, made.name, made.severity) == ("INR099", "negative-mass", "error")
    assert (made.fixes, made.needs, made.family) == ("safe", ("legs",), "INR")
    assert made.title == "A mass is negative."
    assert made.why == "Simulators divide by it.\n\nAnd it is not physical."
    assert made.how_to_fix == "Write the mass of the part."
    assert made.reference == "A book, chapter 3."


def test_rule_defaults(empty):
    rule("INR099", "n", "error")(check())
    assert (empty["INR099"].fixes, empty["INR099"].needs) == ("no", ())


def test_decorator_returns_function(empty):
    function = check()
    assert rule("INR099", "n", "error")(function) is function
    assert empty


@pytest.mark.parametrize(
    "text",
    [
        None,
        "",
        "A title.",
        "A title.\n\nWhy.",
        "A title.\n\nWhy.\n\nFix:\n    This.",
        "A title.\n\nWhy.\n\nSource:\n    That.",
        "A title.\n\nFix:\n    This.\n\nSource:\n    That.",
        "A title\nover lines.\n\nWhy.\n\nFix:\n    This.\n\nSource:\n    That.",
    ],
)
def test_incomplete_page_is_rejected(empty, text):
    rule("INR099", "n", "error")(check(text))
    with pytest.raises(ConfigError, match="docstring of rule INR099: expected a title"):
        _ = empty["INR099"].why


def test_duplicate_code_is_rejected(empty):
    rule("INR099", "one", "error")(check())
    other = check()
    other.__qualname__ = "other"
    expected = r"code INR099: got \S+\.test_rule\.other and \S+\.negative; expected one rule"
    with pytest.raises(ConfigError, match=expected):
        rule("INR099", "two", "error")(other)
    assert empty["INR099"].name == "one"


@pytest.mark.parametrize("code", ["ZZZ001", "INR12", "inr001"])
def test_invalid_code_is_rejected(empty, code):
    with pytest.raises(ConfigError, match=f"rule code: got {code}; expected a family .*INR.* and"):
        rule(code, "n", "error")(check())
    assert not empty


# All of them


def test_rules_are_sorted_by_family_and_number():
    families = list(FAMILIES)
    order = [(families.index(each.family), each.code) for each in rules()]
    assert order == sorted(order)
    assert {each.family for each in rules()} == set(FAMILIES)


def test_importance_orders_every_family():
    assert sorted(IMPORTANCE) == sorted(FAMILIES)


def test_codes_and_names_are_unique():
    assert len({each.code for each in rules()}) == len(rules())
    assert len({each.name for each in rules()}) == len(rules())


def test_every_rule_is_well_formed():
    for each in rules():
        assert re.fullmatch(r"[A-Z]{3}\d{3}", each.code)
        assert re.fullmatch(r"[a-z]+(-[a-z0-9]+)*", each.name)
        assert each.family in FAMILIES, each.code
        assert each.title[0].isupper(), each.title
        assert len(each.title) <= 100, each.title
        for text in (each.title, each.why, each.how_to_fix):
            assert text.endswith("."), text
        assert each.reference.endswith((".", ")", "`")), each.reference
        for text in (each.title, each.why, each.how_to_fix, each.reference):
            assert text.isascii(), text
            assert text == each.title or len(text) > 20, text


@pytest.mark.parametrize("word", ["INR001", "inr001", "Inr001"])
def test_get_rule_by_code(word):
    assert get_rule(word).code == "INR001"


@pytest.mark.parametrize("each", rules()[:10], ids=lambda each: each.code)
def test_get_rule_by_name(each):
    assert get_rule(each.name) is each
    assert get_rule(each.name.upper()) is each


@pytest.mark.parametrize("word", ["INR", "inr999"])
def test_get_rule_unknown_code_lists_family(word):
    with pytest.raises(ConfigError, match=r"no rule .*[Tt]here are: INR001, INR002, .*INR\d+$"):
        get_rule(word)


@pytest.mark.parametrize("word", ["", "no-such-rule"])
def test_get_rule_unknown_name_lists_families(word):
    with pytest.raises(ConfigError, match=r"xpected a code or a name of the families: XML, MSH, "):
        get_rule(word)
