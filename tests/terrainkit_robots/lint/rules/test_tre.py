import pytest

from terrainkit_robots.lint.rule import get_rule
from terrainkit_robots.lint.rules.tre import connections
from terrainkit_robots.lint.runner import MAX_FINDINGS, lint
from tests.small_robots import facts, link
from tests.small_robots import joint as movable

MANY = range(MAX_FINDINGS + 2)


def report(code, *parts):
    return lint(facts(*parts), [get_rule(code)])


def joint(name, parent, child):
    return movable(parent, child, kind="fixed").replace(f"{child}_joint", name)


def links(*names):
    return "".join(link(name, mass=None) for name in names)


@pytest.mark.parametrize(("most", "hints"), [(3, ["FL_foot", "FL_calf", ""]), (2, ["", "", ""])])
def test_unknown_link_suggests_nearest_name_of_small_robots(monkeypatch, most, hints):
    """Names are compared for two unknown links."""
    monkeypatch.setattr(connections, "MAX_COMPARED", most)
    monkeypatch.setattr(connections, "MAX_SUGGESTIONS", 2)
    unknown = [joint(f"j{k}", "base", f"{name}_x") for k, name in enumerate(("FL_foot", "FL_calf"))]
    parts = links("base", "FL_foot", "FL_calf", "FR_calf"), *unknown, joint("j", "base", "fr_calf")
    found = report("TRE002", *parts).findings
    assert "link FL_foot_x: does not exist, but is the child of joint j0" in found[0].message
    for each, name in zip(found, hints, strict=True):
        assert each.hint.startswith(f"Did you mean {name}?" if name else "Correct the name")


def test_long_cycle_is_cut():
    names = [f"l{k}" for k in range(12)]
    around = [joint(f"j{k}", names[k], names[k - 11]) for k in range(12)]
    (finding,) = report("TRE004", links("a", *names), *around).findings
    assert finding.measured["links"] == 12
    assert finding.message.endswith("> ...; expected a tree")
    assert finding.message.count(">") == 6


@pytest.mark.parametrize(
    ("code", "parts"),
    [
        ("TRE001", [links(*(f"l{k // 2}" for k in range(2 * len(MANY))))]),
        (
            "TRE002",
            [
                links(*(f"link_{k}" for k in MANY)),
                *(joint(f"j{k}", "link_0", f"link_{k}_x") for k in MANY),
            ],
        ),
        (
            "TRE003",
            [
                links("a", *(f"l{k}" for k in MANY)),
                *(joint(f"{name}{k}", "a", f"l{k}") for k in MANY for name in "jk"),
            ],
        ),
        ("TRE005", [links(*(f"l{k}" for k in MANY))]),
        ("NAM002", [links(*(f"l{sep}{k}" for k in MANY for sep in " -"))]),
        ("XML006", [link(f"l{k}", mass="x") for k in MANY]),
    ],
)
def test_number_of_findings_is_limited(code, parts):
    checked = report(code, *parts)
    assert len(checked.findings) == MAX_FINDINGS
    assert [each.code for each in checked.skipped] == [code]
    assert str(MAX_FINDINGS) in checked.skipped[0].reason
