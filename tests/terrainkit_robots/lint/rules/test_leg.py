from terrainkit_robots.lint.rule import get_rule
from terrainkit_robots.lint.runner import lint
from tests.small_robots import chain, facts, link


def test_inverted_leg_starts_at_the_height_of_some_leg():
    """The hind legs start 0.4 m above the front legs, further than half of their length."""
    parts = [
        chain("fl_leg", "0.3 0.2 0", (0.3, 0.3)),
        chain("fr_leg", "0.3 -0.2 0", (-0.3, -0.3)),
        chain("rl_leg", "-0.3 0.2 0.4", (0.5, 0.5)),
        chain("rr_leg", "-0.3 -0.2 0.4", (0.5, 0.5)),
    ]
    report = lint(facts(link("trunk", mass=10), *parts), [get_rule("LEG007")])
    assert [each.subject for each in report.findings] == ["fr_leg1"]
