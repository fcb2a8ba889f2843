"""Rules: the checks that run on a robot, each with a code, a name and a documentation page.

A rule is a generator function that takes the `Facts` of a robot and yields its violations. The
docstring of the function is its page in docs/rules.md. It consists of a title, the reason for the
rule, and the sections `Fix:` and `Source:`.

    @rule("INR002", "negative-mass", "error")
    def negative_mass(robot: Facts) -> Violations:
        '''A mass is negative.

        What goes wrong with a negative mass, and in which tools.

        Fix:
            How to correct it.

        Source:
            Where the problem and the threshold are documented.
        '''

Other packages add rules as entry points of the group `terrainkit.rules`. The name of an entry point
is the family of its rules, three capital letters, and its value the module that declares them.
"""

import importlib
import inspect
import pkgutil
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Protocol, get_args

from terrainkit.errors import ConfigError, one_line, plugin_errors
from terrainkit.settings.text import closest, expected_names
from terrainkit_robots.description.fix import Fix, Source
from terrainkit_robots.description.fix import Part as Part

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

    from terrainkit_robots.analysis.facts import Facts

Severity = Literal["error", "warning", "note"]
SEVERITIES: tuple[Severity, ...] = get_args(Severity)
"""Every severity, the most severe first."""

Certainty = Literal["proven", "likely"]
Measured = Mapping[str, float | int | str]

Unit = Literal["mass-unit", "length-unit", "inertia-unit", "angle-unit", "effort-unit"]
"""Names of the rules on units."""

Need = Literal["all-files", "complete-tree", Unit, "mjcf", "simulation", "against", "spec", "legs"]
"""Input that a rule requires: every included file, a kinematic tree without rejected links, a
quantity without a wrong unit, an MJCF file, permission to simulate, a second description of the
robot, its robot.toml, or detected legs."""

COMPLETE: tuple[Need, ...] = ("all-files", "complete-tree")
"""Needs of rules that compare limbs or simulate. On an incomplete robot they would report
consequences of the errors of the tree, or what a missing file may contain."""

UNITS: tuple[Need, ...] = get_args(Unit)
"""Needs of rules that would report a wrong unit of any quantity once more."""

Onboarding = Literal["blocks", "repairs", "converts", "warns", "reports"]
"""What onboarding does about a finding:

- `blocks`: an error prevents onboarding, since the written files would describe another robot, or
  MuJoCo would reject them.
- `repairs`: as `blocks`, but onboarding corrects it where it can: the path of a mesh, a negligible
  inertia, a placeholder of an effort.
- `converts`: an error cannot occur in the written files, since the export rewrites that part.
- `warns`: it is repeated as a warning.
- `reports`: it is listed in report.md.
"""


@dataclass(frozen=True, kw_only=True)
class Family:
    """Rules on one topic, and what all of them have in common."""

    title: str
    """The topic."""

    onboarding: Onboarding = "reports"
    """What onboarding does about a finding, unless the rule declares something else."""

    needs: tuple[Need, ...] = ()
    """Inputs that each rule requires, besides its own."""

    certainty: Certainty = "proven"
    """Certainty of a violation, unless the rule declares another one."""


FAMILIES = {
    "XML": Family(title="XML syntax and schema", onboarding="blocks"),
    "UNI": Family(title="units", certainty="likely", onboarding="blocks"),
    "MSH": Family(title="mesh files", onboarding="blocks"),
    "TRE": Family(title="kinematic tree", onboarding="blocks"),
    "JNT": Family(title="joints"),
    "INR": Family(title="mass and inertia"),
    "COL": Family(title="collision geometry", needs=("all-files", "length-unit")),
    "LEG": Family(title="legs", needs=(*COMPLETE, "legs"), certainty="likely"),
    "SYM": Family(
        title="left-right symmetry", needs=(*COMPLETE, "length-unit"), certainty="likely"
    ),
    "NAM": Family(title="names"),
    "NRM": Family(
        title="comparison with published robots",
        needs=("complete-tree", "length-unit"),
        certainty="likely",
    ),
    "XRF": Family(title="comparison with another file or with the spec"),
    "SIM": Family(title="simulator compatibility"),
    "OPT": Family(title="physics options of MJCF", needs=("all-files",)),
    "DYN": Family(title="simulation", needs=(*COMPLETE, *UNITS)),
}
"""The families by the letters of their codes, in the order in which their rules run."""

TASK_FAMILIES = {"TSK": Family(title="training tasks")}
"""The families of `terrainkit check-task`, whose rules take the `TaskFacts` of a task."""

IMPORTANCE = (
    "UNI",  # one cause of many findings
    *("XML", "TRE", "SIM", "MSH"),  # the robot cannot be loaded
    *("OPT", "INR", "JNT", "COL", "DYN"),  # its physics are wrong
    *("LEG", "XRF", "SYM", "NAM", "NRM"),  # it is not what was meant
)
"""Families in the order of reports: the most important first."""


class Element(Protocol):
    """A part of a robot with a name, such as a link or a joint."""

    @property
    def name(self) -> str:
        """Return the name."""

    @property
    def source(self) -> Source:
        """Return where it is written."""


@dataclass(frozen=True, kw_only=True)
class Violation:
    """One place where a robot violates a rule."""

    message: str
    """One sentence with the measured value, its unit and the threshold."""

    element: Element | None = None
    """What violates the rule, such as a link, a joint or a part of it. By default, the robot."""

    hint: str = ""
    """How to correct it. By default, the `Fix:` section of the rule."""

    severity: Severity | None = None
    """By default, the severity of the rule."""

    certainty: Certainty | None = None
    """`likely` if the violation depends on a heuristic, such as leg detection. By default, the
    certainty of the rule."""

    measured: Measured = field(default_factory=dict)
    """The numbers in the message, by name."""

    fix: Fix | None = None
    """The edits that correct it, if it can be corrected automatically."""

    is_written: bool = True
    """Whether onboarding writes the element. If not, an error does not prevent onboarding."""


@dataclass(frozen=True, kw_only=True)
class Finding(Violation):
    """A violation with the defaults of the rule that found it, as shown in reports."""

    code: str
    """Code of the rule, such as `INR002`."""

    name: str
    """Name of the rule, such as `negative-mass`."""

    subject: str
    """Name of the element."""

    source: Source
    """File and line."""

    severity: Severity
    certainty: Certainty
    onboarding: Onboarding = "reports"
    """What onboarding does about it."""

    @property
    def family(self) -> str:
        """Letters of the code."""
        return self.code[:3]

    @property
    def is_blocking(self) -> bool:
        """Whether it prevents onboarding."""
        is_severe = self.severity == "error" and self.is_written
        return is_severe and self.onboarding in ("blocks", "repairs")

    @property
    def file(self) -> Path:
        """File of the element."""
        return self.source.file

    @property
    def line(self) -> int:
        """Line of the element, or 0 for the whole file."""
        return self.source.line


Violations = Iterator[Violation]

Check = Callable[[Any], Violations | None]
"""A generator of violations of `Facts`, or of `TaskFacts` in the families of tasks. A function
without code reports what the readers recorded."""


class RulePage(NamedTuple):
    """The documentation page of a rule."""

    title: str
    why: str
    """The reason for the rule."""

    how_to_fix: str
    reference: str


@dataclass(frozen=True, kw_only=True)
class Rule:
    """A rule and its documentation page."""

    code: str
    """Family and number. Codes are never reused."""

    name: str
    """Name in lower case with hyphens."""

    severity: Severity
    """Default severity of a violation."""

    check: Check

    fixes: Literal["safe", "unsafe", "no"] = "no"
    """Whether some violations can be fixed automatically."""

    needs: tuple[Need, ...] = ()
    """Inputs that the rule requires. The first one that is missing is the reason in the report."""

    certainty: Certainty = "proven"
    """Default certainty of a violation."""

    onboarding: Onboarding = "reports"
    """What onboarding does about a violation."""

    is_fatal: bool = False
    """Whether a file with a violation may contain no robot."""

    def findings(self, robot: "Facts") -> Iterator[Finding]:
        """Yield the violations on a robot with their defaults filled in."""
        for violation in self._violations(robot):
            element = violation.element or Part(robot.model.title, robot.model.source)
            yield Finding(
                code=self.code,
                name=self.name,
                message=violation.message,
                subject=element.name,
                source=element.source,
                hint=violation.hint or self.page.how_to_fix,
                severity=violation.severity or self.severity,
                certainty=violation.certainty or self.certainty,
                measured=violation.measured,
                fix=violation.fix,
                is_written=violation.is_written,
                onboarding=self.onboarding,
            )

    def _violations(self, robot: "Facts") -> Violations:
        """Yield what the readers recorded under the code, then what the check finds."""
        for problem in robot.model.problems:
            if problem.code == self.code:
                subject = problem.subject or robot.model.name or problem.source.file.name
                yield Violation(
                    element=Part(subject, problem.source),
                    message=problem.message,
                    severity=problem.severity,
                    fix=problem.fix,
                )
        yield from self.check(robot) or ()

    @property
    def family(self) -> str:
        """Return the letters of the code."""
        return self.code[:3]

    @cached_property
    def page(self) -> RulePage:
        """The parts of the docstring.

        Raises:
            ConfigError: if one is missing.
        """
        match = re.fullmatch(
            r"(?P<title>[^\n]+)\n\n(?P<why>.+?)\n\nFix:\n(?P<fix>.+?)\n\nSource:\n(?P<source>.+)",
            inspect.getdoc(self.check) or "",
            re.DOTALL,
        )
        if match is None:
            raise ConfigError(
                f"docstring of rule {self.code}: expected a title, a reason, Fix: and Source:"
            )
        why = "\n\n".join(one_line(paragraph) for paragraph in match["why"].split("\n\n"))
        return RulePage(match["title"], why, one_line(match["fix"]), one_line(match["source"]))


def _need_order(need: Need) -> int:
    """Return the sort key of an input: one whose lack makes results wrong is the first reason."""
    first = (*COMPLETE, *UNITS)
    return first.index(need) if need in first else len(first)


def _path(check: Check) -> str:
    return f"{check.__module__}.{check.__qualname__}"


_RULES: dict[str, Rule] = {}


@cache
def _plugins() -> tuple["EntryPoint", ...]:
    """Return the modules with rules in other packages, whose names are families."""
    from importlib.metadata import entry_points

    return tuple(entry_points(group="terrainkit.rules"))


def families() -> Mapping[str, Family]:
    """Return the families by the letters of their codes, other packages' last."""
    plugins = {point.name: Family(title=f"rules of {point.module}") for point in _plugins()}
    own = FAMILIES | TASK_FAMILIES
    return own | {name: family for name, family in plugins.items() if name not in own}


def rule(
    code: str,
    name: str,
    severity: Severity,
    *,
    fixes: Literal["safe", "unsafe", "no"] = "no",
    needs: tuple[Need, ...] = (),
    certainty: Certainty | None = None,
    onboarding: Onboarding | None = None,
    is_fatal: bool = False,
) -> Callable[[Check], Check]:
    """Return a decorator that registers a function as the rule `code`; see the fields of `Rule`."""
    family = families().get(code[:3])
    if family is None or not re.fullmatch(r"\d{3}", code[3:]):
        known = ", ".join(families())
        raise ConfigError(f"rule code: got {code}; expected a family ({known}) and three digits")

    def register(check: Check) -> Check:
        # A module that is loaded again replaces its rules.
        if code in _RULES and (other := _path(_RULES[code].check)) != _path(check):
            raise ConfigError(
                f"rule code {code}: got {_path(check)} and {other}; expected one rule"
            )
        _RULES[code] = Rule(
            code=code,
            name=name,
            severity=severity,
            check=check,
            fixes=fixes,
            needs=tuple(sorted((*needs, *family.needs), key=_need_order)),
            certainty=certainty or family.certainty,
            onboarding=onboarding or family.onboarding,
            is_fatal=is_fatal,
        )
        return check

    return register


@cache
def rules(subject: Literal["robot", "task"] = "robot") -> tuple[Rule, ...]:
    """Return the rules of robots or of tasks, sorted by family, then by number.

    Raises:
        ConfigError: if the rules of another package cannot be loaded.
    """
    from terrainkit_robots.lint import rules as package

    for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        importlib.import_module(module.name)
    for point in _plugins():
        with plugin_errors(f"rules {point.name} ({point.value}) cannot be loaded"):
            if point.name in FAMILIES | TASK_FAMILIES or not re.fullmatch("[A-Z]{3}", point.name):
                raise ConfigError(f"family: got {point.name}; expected three other capital letters")
            known = set(_RULES)
            point.load()
            for code in _RULES.keys() - known:
                if not code.startswith(point.name):
                    raise ConfigError(f"rule code: got {code}; expected {point.name} and digits")
    order = list(families())
    found = (r for r in _RULES.values() if (r.family in TASK_FAMILIES) == (subject == "task"))
    return tuple(sorted(found, key=lambda r: (order.index(r.family), r.code)))


def get_rule(code_or_name: str) -> Rule:
    """Return the rule with this code or name.

    Args:
        code_or_name: Code such as `JNT007`, or name such as `inverted-limits`, in any case.

    Raises:
        ConfigError: if there is no such rule.
    """
    every = rules() + rules("task")
    known = {key: rule for rule in every for key in (rule.code, rule.name)}
    for key, rule in known.items():
        if key.lower() == code_or_name.lower():
            return rule
    names = [rule.code for rule in every if code_or_name.upper().startswith(rule.family)]
    prefix = "there are" if names else "expected a code or a name of the families"
    suggestion = expected_names(
        code_or_name, names or families(), prefix, closest(code_or_name, known)
    )
    raise ConfigError(f"no rule {code_or_name!r}; {suggestion}")


def findings_of(robot: "Facts", *codes: str) -> Iterator[Finding]:
    """Yield the findings of the rules with these codes.

    For rules that depend on what other rules report.
    """
    for rule in map(get_rule, codes):
        yield from rule.findings(robot)
