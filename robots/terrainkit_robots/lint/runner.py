"""Run rules on a robot and collect their findings in a report."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Literal

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.lint.rule import IMPORTANCE, SEVERITIES, Finding, Need, Rule

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
    """The result of linting one robot."""

    facts: Facts
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

_UNREADABLE = ("XML001", "XML002", "XML005", "XML011")
"""Problems after which a file may contain no robot."""

_NEEDS_ALL_FILES = ("TRE006", "TRE007", "INR001", "COL", "LEG", "SYM", "DYN", "OPT")
"""Families and rules that would report what a missing included file may contain."""

_NEEDS_COMPLETE_TREE = ("LEG", "SYM", "DYN")
"""Families that compare limbs or simulate. On an incomplete tree they would report consequences of
the tree's own errors."""

_UNIT_CONSEQUENCES: Mapping[str, tuple[str, ...]] = {
    "UNI001": ("INR006", "INR007", "INR009", "INR010", "INR011", "JNT011", "JNT015", "JNT026"),
    "UNI002": (
        *("INR006", "INR007", "INR008", "INR010", "INR011", "MSH011", "JNT011", "JNT015", "JNT026"),
        *("COL", "SYM", "LEG005", "LEG006", "LEG007"),
    ),
    "UNI003": ("INR006", "INR007", "JNT023"),
    "UNI004": ("JNT008", "JNT012", "JNT015", "JNT018", "JNT019", "LEG005", "LEG006", "LEG007"),
    "UNI005": ("JNT011", "JNT015", "JNT021", "JNT022", "JNT026"),
}
"""Families and rules that would report consequences of a wrong unit, besides DYN and SIM003."""


def lint(facts: Facts, selected: Sequence[Rule], *, simulate: bool = True) -> Report:
    """Return the report of the selected rules on a robot.

    An exception in one rule does not affect the others. It is recorded in `Report.skipped`.

    Args:
        facts: The robot.
        selected: Rules to run. One that lacks an input is skipped, with the reason.
        simulate: Whether rules may simulate the robot, which takes one or two seconds.
    """
    findings: list[Finding] = []
    skipped: list[Skipped] = []
    if not facts.model.links and any(p.code in _UNREADABLE for p in facts.model.problems):
        selected = [rule for rule in selected if rule.family == "XML"]  # no robot was read
    for rule in selected:
        try:
            _require_complete(rule, facts)
            _require_units(rule, findings)
            missing = _missing_need(rule, facts, simulate=simulate)
            if missing is not None:
                kind: SkipKind = "no-legs" if missing == "legs" else "no-input"
                skipped.append(Skipped(code=rule.code, kind=kind, reason=_MISSING[missing]))
                continue
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


def _require_complete(rule: Rule, facts: Facts) -> None:
    """Raise CannotCheckError if a rule would report consequences of other errors."""
    lacks_file = any(problem.code == "XML012" for problem in facts.model.problems)
    if lacks_file and rule.code.startswith(_NEEDS_ALL_FILES):
        raise CannotCheckError("an included file cannot be read (XML012)")
    if rule.family in _NEEDS_COMPLETE_TREE and facts.tree.rejected:
        raise CannotCheckError("links or joints are missing from the kinematic tree")


def _require_units(rule: Rule, findings: Sequence[Finding]) -> None:
    """Raise CannotCheckError if a rule would report consequences of a wrong unit."""
    for code in {finding.code for finding in findings} & _UNIT_CONSEQUENCES.keys():
        if rule.code.startswith((*_UNIT_CONSEQUENCES[code], "DYN", "SIM003")):
            raise CannotCheckError(f"a quantity has another unit ({code})")


def _importance(finding: Finding) -> tuple[int, int, str, str, int]:
    """Return the sort key of a finding."""
    severity = SEVERITIES.index(finding.severity)
    family = IMPORTANCE.index(finding.code[:3])
    return severity, family, finding.code, str(finding.file), finding.line


def has_inputs(rule: Rule, facts: Facts, *, simulate: bool) -> bool:
    """Return whether the user provided the inputs of a rule: other file, spec, simulation."""
    return _missing_need(rule, facts, simulate=simulate) in (None, "legs")


_MISSING: dict[Need, str] = {
    "mjcf": "only MJCF has physics settings",
    "simulation": "simulation is disabled",
    "against": "no second file to compare with; use --against FILE",
    "spec": "no robot.toml to compare with; use --spec FILE",
    "legs": "no legs detected",
}
"""Reason for not running a rule that lacks an input."""


def _missing_need(rule: Rule, facts: Facts, *, simulate: bool) -> Need | None:
    """Return the first input that a rule lacks, or None if it can run."""
    lacks: dict[Need, Callable[[], bool]] = {
        "mjcf": lambda: facts.model.kind != "mjcf",
        "simulation": lambda: not simulate,
        "against": lambda: facts.against is None,
        "spec": lambda: facts.spec is None,
        "legs": lambda: not facts.legs,
    }
    return next((need for need in rule.needs if lacks[need]()), None)
