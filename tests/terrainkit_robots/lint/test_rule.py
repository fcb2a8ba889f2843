import re

import pytest

from terrainkit.errors import ConfigError
from terrainkit_robots.lint import rule as module
from terrainkit_robots.lint.rule import FAMILIES, IMPORTANCE, Violation, get_rule, rule, rules
from tests.tables import read_table

PAGE = read_table(__file__, "page")


@pytest.fixture
def empty(monkeypatch):
    """Return an empty registry."""
    registry = {}
    monkeypatch.setattr(module, "_RULES", registry)
    return registry


def check(text=PAGE):
    def negative(robot):
        yield Violation(element=robot.model, message="b")

    negative.__doc__ = text
    return negative


def test_rule_page_is_parsed(empty):
    function = check()
    given = {"fixes": "safe", "needs": ("legs",)}
    assert rule("INR099", "negative-mass", "error", **given)(function) is function
    expected = given | read_table(__file__, "rule_page_is_parsed")
    made = empty["INR099"]
    found = {name: getattr(made, name, getattr(made.page, name, None)) for name in expected}
    assert found == expected
    rule("INR098", "n", "error")(check())
    assert (empty["INR098"].fixes, empty["INR098"].needs) == ("no", ())


@pytest.mark.parametrize(
    "text",
    [
        *read_table(__file__, "incomplete_page_is_rejected"),
        None,
    ],
)
def test_incomplete_page_is_rejected(empty, text):
    rule("INR099", "n", "error")(check(text))
    with pytest.raises(ConfigError, match="docstring of rule INR099: expected a title"):
        _ = empty["INR099"].page


def test_duplicate_and_invalid_codes_are_rejected(empty):
    rule("INR099", "one", "error")(check())
    other = check()
    other.__qualname__ = "other"
    expected = r"code INR099: got \S+\.test_rule\.other and \S+\.negative; expected one rule"
    with pytest.raises(ConfigError, match=expected):
        rule("INR099", "two", "error")(other)
    for code in ("ZZZ001", "INR12", "inr001"):
        with pytest.raises(ConfigError, match=f"rule code: got {code}; expected a family .*INR"):
            rule(code, "n", "error")(check())
    assert [each.name for each in empty.values()] == ["one"]


# All of them


def test_rules_are_unique_and_sorted_by_family_and_number():
    order = [(list(FAMILIES).index(each.family), each.code) for each in rules()]
    assert order == sorted(set(order))
    assert {each.family for each in rules()} == set(FAMILIES) == set(IMPORTANCE)
    assert len({each.name for each in rules()}) == len(rules())


def test_every_rule_is_well_formed():
    for each in rules():
        assert re.fullmatch(r"[A-Z]{3}\d{3} [a-z]+(-[a-z0-9]+)*", f"{each.code} {each.name}")
        title, *texts = each.page
        assert re.fullmatch(r"[A-Z].{,98}\.", title), title
        assert all(text.endswith(".") for text in texts[:2]), texts
        assert texts[2].endswith((".", ")", "`")), texts
        assert all(text.isascii() and len(text) > 20 for text in texts), texts


def test_get_rule_by_code_or_name():
    for each in rules()[:10]:
        for word in (each.code, each.code.lower(), each.name, each.name.upper()):
            assert get_rule(word) is each


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("inr999", r"no rule .*[Tt]here are: INR001, INR002, .*INR\d+$"),
        ("no-such-rule", r"xpected a code or a name of the families: XML, UNI, MSH, "),
    ],
)
def test_get_rule_lists_what_exists(word, message):
    with pytest.raises(ConfigError, match=message):
        get_rule(word)
