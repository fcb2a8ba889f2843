import re

import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.rule import rules
from tests.robots import BUNDLED, QUADRUPED, REAL_ROBOTS


def check(path, text=None):
    """Return code and subject of the findings of the SYM rules."""
    contents = {} if text is None else {path: text.encode()}
    facts = Facts(load_robot(path, contents=contents))
    return [
        (rule.code, violation.subject)
        for rule in rules()
        if rule.family == "SYM"
        for violation in rule.findings(facts)
    ]


def replace(text, tag, name, pattern, replacement):
    """Return the text with one replacement inside the link or joint of that name."""
    start = re.search(rf'<{tag}\s+name="{name}"', text).start()
    end = text.index(f"</{tag}>", start)
    block, count = re.subn(pattern, replacement, text[start:end], count=1)
    assert count == 1
    return text[:start] + block + text[end:]


@pytest.mark.parametrize("name", [*BUNDLED, *REAL_ROBOTS])
def test_sym_accepts_published_robots(robot_file, name):
    assert check(robot_file(name)) == []


@pytest.mark.parametrize("leg", ["FL", "FR", "RL", "RR"])
@pytest.mark.parametrize(
    ("tag", "name", "pattern", "replacement", "finding"),
    [
        ("link", "thigh", r'<mass\s+value="[^"]*"', '<mass value="1.4"', "SYM001"),
        ("link", "thigh", r'<origin\s+xyz="\S+ ', '<origin xyz="0.03 ', "SYM002"),
        ("joint", "thigh_joint", r'upper="[^"]*"', 'upper="2"', "SYM004"),
        ("joint", "thigh_joint", r'effort="[^"]*"', 'effort="20"', "SYM005"),
        ("joint", "calf_joint", r"-0\.213", "-0.18", "SYM006"),
        ("joint", "thigh_joint", r"<origin", '<origin rpy="0 0.3 0"', "SYM006"),
        ("joint", "thigh_joint", r"<origin", '<origin rpy="0.3 0 0"', "SYM006"),
        ("joint", "thigh_joint", r'axis\s+xyz="0 1 0"', 'axis xyz="0 -1 0"', "SYM007"),
        ("joint", "hip_joint", r'axis\s+xyz="1 0 0"', 'axis xyz="-1 0 0"', "SYM007"),
        ("joint", "calf_joint", r'axis\s+xyz="0 1 0"', 'axis xyz="0.2 0.98 0"', "SYM007"),
    ],
)
def test_sym_reports_modified_leg(leg, tag, name, pattern, replacement, finding):
    text = replace(QUADRUPED.read_text(), tag, f"{leg}_{name}", pattern, replacement)
    assert check(QUADRUPED, text) == [(finding, f"{leg}_{name}")]


def test_sym_reports_no_child_joints(robot_file):
    biped = robot_file("biped.urdf")
    rotated = '<origin rpy="0.2 0 0"'
    modified = replace(biped.read_text(), "joint", "left_hip_roll_joint", "<origin", rotated)
    assert {code for code, _ in check(biped, modified)} == {"SYM006"}
    assert len(check(biped, modified)) == 1
