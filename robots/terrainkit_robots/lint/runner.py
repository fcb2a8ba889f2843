"""Run rules on a robot and collect their findings in a report."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any, Literal

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.lint.rule import IMPORTANCE, SEVERITIES, UNITS, Finding, Need, Rule, get_rule

Verdict = Literal["pass", "warn", "fail"]


SkipKind = Literal[
    "cannot-check", "no-legs", "no-input", "truncated", "crashed", "ignored", "suppressed", "unused"
]
"""Why a rule or a finding is not in the report:

- `cannot-check`: the rule cannot be evaluated for this robot.
- `no-legs`: the rule only applies to legged robots.
- `no-input`: the file is not MJCF, or the user did not provide a second file, a spec, or permission
  to simulate.
- `truncated`: only the first findings of the rule are reported.
- `crashed`: the rule raised an unexpected exception.
- `ignored`: the settings ignore the rule.
- `suppressed`: a comment in the file suppresses the finding, or the baseline file records it.
- `unused`: a suppression comment or an entry of the baseline file has no effect.
"""

INTERNAL_ERROR = "internal error, please report it"
"""Description of an unexpected exception."""


@dataclass(frozen=True, kw_only=True)
class Skipped:
    """A rule that could not run or was ignored."""

    code: str
    """Code of the rule."""

    kind: SkipKind
    reason: str
    """What was missing, as a sentence."""


@dataclass(frozen=True, kw_only=True)
class Report:
    """The result of linting one robot or task."""

    facts: Any
    """The `Facts` of the robot, or the `TaskFacts` of a task."""

    findings: tuple[Finding, ...]
    """Findings, the most important first: by severity, family, rule, file and line."""

    skipped: tuple[Skipped, ...] = ()
    """Rules that could not run or were ignored, and suppressed findings."""

    completed: frozenset[str] = frozenset()
    """Codes of the rules that ran and reported all that they found."""

    may_simulate: bool = False
    """Whether rules were allowed to simulate the robot."""

    fixed: tuple[Finding, ...] = ()
    """Findings that were fixed before this report."""

    unfixed: tuple[tuple[Finding, str], ...] = ()
    """Findings with a fix that was not applied, and the reasons."""

    @property
    def crashed(self) -> tuple[Skipped, ...]:
        """The rules that raised an unexpected exception."""
        return tuple(rule for rule in self.skipped if rule.kind == "crashed")

    @property
    def verdict(self) -> Verdict:
        """`fail` if there are errors, `warn` if there are warnings, else `pass`."""
        severities = {finding.severity for finding in self.findings}
        return "fail" if "error" in severities else "warn" if "warning" in severities else "pass"


MAX_FINDINGS = 50
"""Maximum number of findings of one rule."""


def lint(facts: Any, selected: Sequence[Rule], *, simulate: bool = True) -> Report:
    """Return the report of the selected rules on a robot.

    An exception in one rule does not affect the others. It is recorded in `Report.skipped`.

    Args:
        facts: The `Facts` of the robot, or the `TaskFacts` of a task.
        selected: Rules to run. One that lacks an input is skipped, with the reason.
        simulate: Whether rules may simulate the robot, which takes one or two seconds.
    """
    findings: list[Finding] = []
    skipped: list[Skipped] = []
    if not facts.model.links and any(get_rule(p.code).is_fatal for p in facts.model.problems):
        selected = [rule for rule in selected if rule.family == "XML"]  # no robot was read
    for rule in selected:
        try:
            skip = _why_skipped(rule, facts, findings, simulate=simulate)
            if skip is not None:
                skipped.append(skip)
                continue
            # One more than reported, to tell whether there are more. A rule may have no end.
            found = list(islice(rule.findings(facts), MAX_FINDINGS + 1))
            findings += found[:MAX_FINDINGS]
            if len(found) > MAX_FINDINGS:
                reason = f"more than {MAX_FINDINGS} findings; only the first are reported"
                skipped.append(Skipped(code=rule.code, kind="truncated", reason=reason))
        except CannotCheckError as error:
            skipped.append(Skipped(code=rule.code, kind="cannot-check", reason=str(error)))
        except MemoryError:
            raise
        except Exception as error:
            # A bug in one rule must not hide the findings of the others. Tests assert on `crashed`.
            reason = f"{INTERNAL_ERROR}: {type(error).__name__}: {error}"
            skipped.append(Skipped(code=rule.code, kind="crashed", reason=reason))
    findings.sort(key=_importance)
    return Report(
        facts=facts, findings=tuple(findings), skipped=tuple(skipped), may_simulate=simulate
    )


def _importance(finding: Finding) -> tuple[int, int, str, str, int]:
    """Return the sort key of a finding."""
    severity = SEVERITIES.index(finding.severity)
    family = (*IMPORTANCE, finding.family).index(finding.family)
    return severity, family, finding.code, str(finding.file), finding.line


_REASONS: Mapping[Need, str] = {
    "all-files": "an included file cannot be read (XML012)",
    "complete-tree": "links or joints are missing from the kinematic tree",
    "mjcf": "only MJCF has physics settings",
    "simulation": "simulation is disabled",
    "against": "no second file to compare with; use --against FILE",
    "spec": "no robot.toml to compare with; use --spec FILE",
    "legs": "no legs detected",
}
"""Reason for not running a rule that lacks an input."""

_KINDS: Mapping[Need, SkipKind] = {
    "all-files": "cannot-check",
    "complete-tree": "cannot-check",
    "legs": "no-legs",
}
"""Kind of that reason. The user provides the other inputs."""


def has_inputs(rule: Rule, facts: Facts, *, simulate: bool) -> bool:
    """Return whether the user provided the inputs of a rule: other file, spec, simulation.

    A rule whose first missing input is legs is in the report, as skipped.
    """
    lacks = (n for n in rule.needs if _is_missing(n, facts, simulate=simulate))
    return next((n for n in lacks if _KINDS.get(n) != "cannot-check"), "legs") == "legs"


def _why_skipped(
    rule: Rule, facts: Facts, findings: Sequence[Finding], *, simulate: bool
) -> Skipped | None:
    """Return why a rule does not run, or None if it does."""
    wrong_units = {finding.name: finding.code for finding in findings if finding.name in UNITS}
    for need in rule.needs:
        if need in wrong_units:
            reason = f"a quantity has another unit ({wrong_units[need]})"
            return Skipped(code=rule.code, kind="cannot-check", reason=reason)
        if _is_missing(need, facts, simulate=simulate):
            kind = _KINDS.get(need, "no-input")
            return Skipped(code=rule.code, kind=kind, reason=_REASONS[need])
    return None


def _is_missing(need: Need, facts: Facts, *, simulate: bool) -> bool:
    """Return whether an input of rules is missing."""
    match need:
        case "all-files":
            return any(problem.code == "XML012" for problem in facts.model.problems)
        case "complete-tree":
            return bool(facts.tree.rejected)
        case "mjcf":
            return facts.model.kind != "mjcf"
        case "simulation":
            return not simulate
        case "against":
            return facts.against is None
        case "spec":
            return facts.spec is None
        case "legs":
            return not facts.legs
    return False  # a unit, of which rules report the errors
