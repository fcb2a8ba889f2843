import re

from terrainkit_robots.lint.rule import get_rule
from terrainkit_robots.lint.runner import lint
from tests.robots import QUADRUPED
from tests.small_robots import facts


def test_sides_are_found_within_words():
    """The words hipl, thighl and calfl have l in common, and their mirror images r."""
    text = re.sub(
        r'"(F|R)(L|R)_(hip|thigh|calf)_joint"',
        lambda name: f'"{name[1]}_{name[3]}{name[2].lower()}"',
        QUADRUPED.read_text(),
    )
    for change, subjects in (("", []), ("R_thghr", ["R_thghr"])):
        robot = facts(text.replace("R_thighr", change or "R_thighr"))
        assert [each.subject for each in lint(robot, [get_rule("NAM001")]).findings] == subjects
