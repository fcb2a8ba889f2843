"""Report the problems that the readers recorded, as violations of the rules with their codes."""

from collections.abc import Iterator

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.fix import Fix
from terrainkit_robots.description.model import Problem
from terrainkit_robots.lint.rule import Severity, Violation, Violations


def problems(robot: Facts, code: str) -> Iterator[Problem]:
    """Yield the problems with a code."""
    return (problem for problem in robot.model.problems if problem.code == code)


def problem_violation(
    robot: Facts, problem: Problem, fix: Fix | None = None, severity: Severity | None = None
) -> Violation:
    """Return the violation of a problem."""
    return Violation(
        subject=problem.subject or robot.model.name or problem.source.file.name,
        source=problem.source,
        message=problem.message,
        severity=severity,
        fix=fix,
    )


def problem_violations(robot: Facts, code: str, severity: Severity | None = None) -> Violations:
    """Yield the violations of the problems with a code, none of which can be fixed."""
    return (
        problem_violation(robot, problem, severity=severity) for problem in problems(robot, code)
    )
