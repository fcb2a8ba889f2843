import re

import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.lint.rule import rules
from terrainkit_robots.lint.runner import lint
from tests.small_robots import facts, mjcf, tree_text

XRF = [rule for rule in rules() if "against" in rule.needs]


@pytest.mark.parametrize("name", ["quadruped", "biped"])
@pytest.mark.parametrize("suffixes", [(".urdf", ".xml"), (".xml", ".urdf")])
def test_bundled_robots_agree(robot_of, name, suffixes):
    one, other = (robot_of(name + suffix) for suffix in suffixes)
    report = lint(Facts(one.model, against=other), XRF)
    assert (report.findings, report.skipped) == ((), ())


def test_permutation_in_message_is_correct():
    """The list in the message reorders values from joint order to actuator order."""
    names = ["c", "a", "d", "b"]
    joint = '<body name="{0}"><joint name="{0}" range="-1 1"/><geom size="0.1"/></body>'
    bodies = "".join(joint.format(name) for name in "abcd")
    motors = "".join(f'<motor name="{name}" joint="{name}"/>' for name in names)
    one = mjcf(
        f'<body name="base"><geom size="0.1"/>{bodies}</body>', f"<actuator>{motors}</actuator>"
    )
    other = facts(tree_text(*(f"{name}: base > {name}" for name in "abcd")))
    report = lint(Facts(one.model, against=other), XRF)
    (finding,) = [each for each in report.findings if each.code == "XRF005"]
    order = re.search(r"ctrl = joints\[\[([\d, ]+)\]\]", finding.message)[1]
    assert ["abcd"[int(place)] for place in order.split(",")] == names


def test_robot_without_links_is_skipped(robot_of):
    empty = robot_of('<robot name="nothing"/>')
    report = lint(Facts(robot_of("quadruped.urdf").model, against=empty), XRF)
    assert report.findings == report.crashed == ()
    assert len(report.skipped) == len(XRF)
    assert "has no links" in report.skipped[0].reason
