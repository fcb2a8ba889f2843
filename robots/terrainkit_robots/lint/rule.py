"""Rules: what each one is called, why it is there, and what it finds.

A rule is a function from the facts of a robot to its violations. Its docstring is its page in
docs/rules.md: a title, a paragraph that says why, the sections `Fix:` and `Source:`.

    @rule("INR002", "negative-mass", "error")
    def negative_mass(robot: Facts) -> Iterator[Violation]:
        '''A mass is negative.

        Why this goes wrong, and where.

        Fix:
            What to do.

        Source:
            Where this is known from.
        '''
"""

import importlib
import inspect
import pkgutil
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, Literal

from terrainkit.errors import ConfigError, listing
from terrainkit_robots.description.fix import Fix
from terrainkit_robots.description.model import Source

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts

Severity = Literal["error", "warning", "info"]
Certainty = Literal["proven", "likely"]
Measured = Mapping[str, float | int | str]

Need = Literal["legs", "simulation", "against", "spec"]
"""What a rule cannot be asked without: legs that were found, leave to simulate, another description
of the robot, its robot.toml."""

FAMILIES = {
    "XML": "what is written",
    "MSH": "mesh files",
    "TRE": "the tree of links and joints",
    "JNT": "joints",
    "INR": "masses and inertias",
    "COL": "collision shapes",
    "LEG": "legs",
    "SYM": "left and right",
    "NAM": "names",
    "XRF": "the robot against another file of it, or its spec",
    "SIM": "what simulators make of it",
    "DYN": "the robot simulated",
}


@dataclass(frozen=True, kw_only=True)
class Violation:
    """One thing that a rule found."""

    subject: str
    """Name of the link, joint, mesh or file."""

    source: Source
    """Where it is written."""

    message: str
    """What was measured, what the threshold is: one sentence, with numbers and units."""

    hint: str = ""
    """What to do about it; empty for what the rule says in general."""

    severity: Severity | None = None
    """If it is another than the rule's."""

    certainty: Certainty = "proven"
    """Likely where it rests on a guess, such as which links are legs."""

    measured: Measured = field(default_factory=dict)
    """The numbers of the message, by name."""

    fix: Fix | None = None
    """How to repair it, where that can be done."""


Check = Callable[["Facts"], Iterator[Violation]]


@dataclass(frozen=True, kw_only=True)
class Rule:
    """A rule and its page."""

    code: str
    """Family and number; never used again for something else."""

    name: str
    """The same in words."""

    severity: Severity
    """How bad a violation is, where it does not say otherwise itself."""

    check: Check

    fixes: Literal["safe", "unsafe", "no"] = "no"
    """Whether it repairs what it finds, or some of that."""

    needs: tuple[Need, ...] = ()
    """What it cannot be asked without."""

    @property
    def family(self) -> str:
        """Return the letters of the code."""
        return self.code[:3]

    @property
    def title(self) -> str:
        """Return the first line of the page."""
        return self._page[0]

    @property
    def why(self) -> str:
        """Return why the rule is there."""
        return self._page[1]

    @property
    def how_to_fix(self) -> str:
        """Return what to do about a violation."""
        return self._page[2]

    @property
    def reference(self) -> str:
        """Return where the rule and its threshold come from."""
        return self._page[3]

    @property
    def _page(self) -> tuple[str, str, str, str]:
        text = inspect.getdoc(self.check) or ""
        match = re.fullmatch(
            r"(?P<title>[^\n]+)\n\n(?P<why>.+?)\n\nFix:\n(?P<fix>.+?)\n\nSource:\n(?P<source>.+)",
            text,
            re.DOTALL,
        )
        if match is None:
            raise ConfigError(f"{self.code}: the docstring lacks a title, why, Fix: or Source:")
        why = "\n\n".join(_flow(paragraph) for paragraph in match["why"].split("\n\n"))
        return match["title"], why, _flow(match["fix"]), _flow(match["source"])


def _flow(text: str) -> str:
    return " ".join(text.split())


_RULES: dict[str, Rule] = {}


def rule(
    code: str,
    name: str,
    severity: Severity,
    *,
    fixes: Literal["safe", "unsafe", "no"] = "no",
    needs: tuple[Need, ...] = (),
) -> Callable[[Check], Check]:
    """Return a decorator that makes a function the rule `code`."""

    def register(check: Check) -> Check:
        if code in _RULES and _RULES[code].check.__module__ != check.__module__:
            raise ConfigError(f"two rules are called {code}")
        _RULES[code] = Rule(
            code=code, name=name, severity=severity, check=check, fixes=fixes, needs=needs
        )
        return check

    return register


@cache
def rules() -> tuple[Rule, ...]:
    """Return every rule: by family in the order of FAMILIES, then by number."""
    from terrainkit_robots.lint import rules as package

    for module in pkgutil.iter_modules(package.__path__):
        importlib.import_module(f"{package.__name__}.{module.name}")
    order = list(FAMILIES)
    return tuple(sorted(_RULES.values(), key=lambda r: (order.index(r.family), r.code)))


def get_rule(word: str) -> Rule:
    """Return the rule whose code or name is `word`.

    Raises:
        ConfigError: if there is none.
    """
    for each in rules():
        if word.upper() == each.code or word.lower() == each.name:
            return each
    raise ConfigError(f"no rule {word!r}; there are: {listing(r.code for r in rules())}")
