import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.rule import get_rule
from terrainkit_robots.lint.runner import MOST_FINDINGS, lint


@pytest.fixture
def report(tmp_path):
    def check(code, *parts):
        path = tmp_path / "robot.urdf"
        path.write_text(f'<robot name="r">{"".join(parts)}</robot>')
        return lint(Facts(load_robot(path)), [get_rule(code)])

    return check


def joint(name, parent, child, kind="fixed"):
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}</joint>'


def links(*names):
    return "".join(f'<link name="{name}"/>' for name in names)


def test_the_link_that_was_meant_is_named_case_included(report):
    said = report("TRE002", links("base", "FL_foot", "FL_calf"), joint("j", "base", "fl_foot"))
    (finding,) = said.findings
    assert "link fl_foot is not there, but is the child of joint j" in finding.message
    assert finding.hint.startswith("Is link FL_foot meant?")


def test_a_long_circle_is_cut(report):
    names = [f"l{k}" for k in range(12)]
    around = [joint(f"j{k}", names[k], names[k - 11]) for k in range(12)]
    (finding,) = report("TRE004", links("a", *names), *around).findings
    assert finding.measured["links"] == 12
    assert finding.message.endswith("> ...; wanted a tree")
    assert finding.message.count(">") == 6


MANY = 6000


@pytest.mark.parametrize(
    ("code", "parts"),
    [
        pytest.param(
            "TRE001", [links(*(f"l{k // 2}" for k in range(2 * MANY)))], id="links of one name"
        ),
        pytest.param(
            "TRE002",
            [
                links(*(f"link_{k}" for k in range(MANY))),
                *(joint(f"j{k}", "link_0", f"link_{k}_x") for k in range(MANY)),
            ],
            id="links that are not there",
        ),
        pytest.param(
            "TRE003",
            [
                links("a", *(f"l{k}" for k in range(MANY))),
                *(joint(f"{name}{k}", "a", f"l{k}") for k in range(MANY) for name in "jk"),
            ],
            id="two parents",
        ),
        pytest.param("TRE005", [links(*(f"l{k}" for k in range(MANY)))], id="roots"),
        pytest.param(
            "NAM002", [links(*(f"l{sep}{k}" for k in range(MANY) for sep in " -"))], id="clashes"
        ),
        pytest.param(
            "XML006",
            [
                f'<link name="l{k}"><inertial><mass value="x"/></inertial></link>'
                for k in range(MANY)
            ],
            id="numbers that are none",
        ),
    ],
)
def test_of_thousands_the_first_are_told_and_that_there_are_more(report, code, parts):
    said = report(code, *parts)
    assert len(said.findings) == MOST_FINDINGS
    assert [each.code for each in said.skipped] == [code]
    assert str(MOST_FINDINGS) in said.skipped[0].reason
