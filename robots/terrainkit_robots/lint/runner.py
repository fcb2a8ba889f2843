"""Linting: every rule that was selected, on one robot, in one pass."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Literal

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.fix import Fix
from terrainkit_robots.lint.rule import Certainty, Measured, Rule, Severity, Violation, rules

Verdict = Literal["pass", "warn", "fail"]


INTERNAL = "internal error, please report it"
"""How the reason of a rule begins that raised what it should not."""


@dataclass(frozen=True, kw_only=True)
class Finding:
    """A violation and the rule that found it: what the reports print."""

    code: str
    name: str
    severity: Severity
    certainty: Certainty
    subject: str
    message: str
    hint: str
    file: Path
    line: int
    measured: Measured = field(default_factory=dict)
    fix: Fix | None = None


@dataclass(frozen=True, kw_only=True)
class Skipped:
    """A rule that could not be asked, or was told to be quiet."""

    code: str
    reason: str


@dataclass(frozen=True, kw_only=True)
class Report:
    """Everything that is to be said of one robot."""

    facts: Facts
    findings: tuple[Finding, ...]
    """Errors first, then by place in the file."""

    skipped: tuple[Skipped, ...] = ()

    simulated: bool = False
    """Whether the robot was simulated where a rule wanted that."""

    @property
    def crashed(self) -> tuple[Skipped, ...]:
        """The rules that raised what they should not have."""
        return tuple(each for each in self.skipped if each.reason.startswith(INTERNAL))

    @property
    def verdict(self) -> Verdict:
        """Fail with an error, warn with a warning, else pass."""
        severities = {finding.severity for finding in self.findings}
        return "fail" if "error" in severities else "warn" if "warning" in severities else "pass"


MOST_FINDINGS = 50
"""So many violations of one rule are told: of 10,000 alike nobody reads the last."""

_UNREADABLE = ("XML001", "XML002", "XML005", "XML011")
"""Problems that can leave nothing of a file."""

_OF_WHOLE_ROBOTS = ("LEG", "SYM")
"""Families that compare limbs, and would tell again what a broken tree has lost."""


def lint(facts: Facts, chosen: Sequence[Rule] | None = None, *, simulate: bool = True) -> Report:
    """Return what the rules find on a robot.

    Args:
        facts: The robot.
        chosen: Rules to ask; unless told all of those for which there is what they need.
        simulate: Whether the rules that simulate may do so, which takes a second or two.
    """
    findings: list[Finding] = []
    skipped: list[Skipped] = []
    if chosen is None:
        chosen = [rule for rule in rules() if is_applicable(rule, facts, simulate=simulate)]
    if not facts.model.links and any(p.code in _UNREADABLE for p in facts.model.problems):
        chosen = [rule for rule in chosen if rule.family == "XML"]  # there is no robot to look at
    for each in chosen:
        try:
            if each.family in _OF_WHOLE_ROBOTS and facts.tree.left_out:
                raise CannotCheckError("links or joints are missing from the tree")
            missing = _missing(each, facts, simulate=simulate)
            if missing:
                raise CannotCheckError(missing)
            violations = list(islice(each.check(facts), MOST_FINDINGS + 1))
            findings += [_finding(each, violation) for violation in violations[:MOST_FINDINGS]]
            if len(violations) > MOST_FINDINGS:
                reason = f"it found more than the {MOST_FINDINGS} violations that are shown"
                skipped.append(Skipped(code=each.code, reason=reason))
        except CannotCheckError as cannot:
            skipped.append(Skipped(code=each.code, reason=str(cannot)))
        except MemoryError:
            raise
        except Exception as error:
            # One rule that fails on a strange robot must not cost what the others found; that it
            # failed is told, and the tests take it for the bug that it is.
            reason = f"{INTERNAL}: {type(error).__name__}: {error}"
            skipped.append(Skipped(code=each.code, reason=reason))
    order = {"error": 0, "warning": 1, "info": 2}
    findings.sort(key=lambda f: (order[f.severity], str(f.file), f.line, f.code))
    return Report(facts=facts, findings=tuple(findings), skipped=tuple(skipped), simulated=simulate)


def is_applicable(rule: Rule, facts: Facts, *, simulate: bool) -> bool:
    """Return whether the inputs that a rule needs were given: other file, spec, simulation."""
    missing = _missing(rule, facts, simulate=simulate)
    return missing not in (_NO_OTHER, _NO_SPEC, _NO_SIMULATION)


_NO_LEGS = "no legs were found"
_NO_OTHER = "there is no other file to compare with; --against names one"
_NO_SPEC = "there is no robot.toml to compare with; --spec names one"
_NO_SIMULATION = "nothing is simulated here"


def _missing(rule: Rule, facts: Facts, *, simulate: bool) -> str:
    """Return which of its needs a rule lacks, as a reason; empty if it can be asked."""
    if "simulation" in rule.needs and not simulate:
        return _NO_SIMULATION
    if "against" in rule.needs and facts.against is None:
        return _NO_OTHER
    if "spec" in rule.needs and facts.spec is None:
        return _NO_SPEC
    if "legs" in rule.needs and not facts.legs:
        return _NO_LEGS
    return ""


def _finding(rule: Rule, violation: Violation) -> Finding:
    return Finding(
        code=rule.code,
        name=rule.name,
        severity=violation.severity or rule.severity,
        certainty=violation.certainty,
        subject=violation.subject,
        message=violation.message,
        hint=violation.hint or rule.how_to_fix,
        file=violation.source.file,
        line=violation.source.line,
        measured=violation.measured,
        fix=violation.fix,
    )
