"""A kind of defect: TOML data that says which elements of a robot are edited, and how."""

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from . import mesh_edits, name_edits, physics_edits  # noqa: F401  (registers their edits)
from .edits import apply_edits
from .mutant import Element, Mutant, NotApplicableError

_SELECTIONS = {"pick", "pick_two", "pick_mesh", "each"}
Edits = Sequence[Mapping[str, Any]]


@dataclass(frozen=True, kw_only=True)
class Defect:
    """A kind of defect. README.md in this folder describes the format.

    Attributes:
        title: Name of the kind; part of the seed.
        pick: XPath of the elements of which a random one gets the defect.
        pick_two: The same for two; `$other` is the second.
        pick_mesh: XPath of the links of which a random collision mesh gets the defect.
        each: XPath of the elements that all get the defect.
        prepare: Edits before the elements are selected.
        edits: Edits that add the defect.
        when: XPath condition; the defect is not applicable if it is false.
        names: Names of the broken elements that a finding may be about.
        about: Regular expression of a finding on a defect of the whole file.
        codes: The rules of which one must report the defect.
        severity: Lowest severity that counts.
        format: Format of the robots that it is applied to.
        robots: Names of the robots that it is applied to.
        family: Family of the kind.
        description: What is wrong.
        reason: A tracker issue, or why it happens in practice.
    """

    title: str
    edits: Edits
    prepare: Edits = ()
    pick: str = ""
    pick_two: str = ""
    pick_mesh: str = ""
    each: str = ""
    when: str = ""
    names: Sequence[str] = ()
    about: str = ""
    codes: Sequence[str] = ()
    severity: str = ""
    format: str = "urdf"
    robots: Sequence[str] = ()
    family: str = ""
    description: str = ""
    reason: str = ""

    def apply(self, mutant: Mutant) -> tuple[str, ...]:
        """Add the defect to a mutant.

        Returns:
            The names of the broken elements.

        Raises:
            NotApplicableError: If the robot has no element to which the defect applies.
        """
        apply_edits(mutant, self.prepare)
        broken = self._select(mutant)
        names: list[str] = []
        for element in broken:
            mutant.it = element
            if self.when and not mutant.xpath(self.when):
                raise NotApplicableError(self.when)
            apply_edits(mutant, self.edits)
        for element in broken:
            mutant.it = element
            names += mutant.fill_names(self.names)
        return tuple(dict.fromkeys(names))

    def _select(self, mutant: Mutant) -> list[Element]:
        if self.pick:
            return [mutant.pick(mutant.select(self.pick))]
        if self.pick_two:
            candidates = mutant.select(self.pick_two)
            one, other = mutant.rng.sample(candidates, 2)
            mutant.variables["other"] = [other]
            return [one]
        if self.pick_mesh:
            return [mesh_edits.pick_mesh(mutant, self.pick_mesh)]
        return mutant.select(self.each) if self.each else [mutant.root]


def load_defects(path: Path) -> Iterator[Defect]:
    """Yield the defects in a TOML file; the keys at its top are defaults for all of them."""
    table = tomllib.loads(path.read_text(encoding="utf-8"))
    defects = table.pop("defect")
    for defect in defects:
        if not defect.keys() & _SELECTIONS:
            defect.setdefault("names", ())
        yield Defect(**table | defect)
