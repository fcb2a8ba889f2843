"""Check the inertials of links, and find where they are written."""

from collections.abc import Iterable, Iterator

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.inertia.merged_inertia import parallel_axis
from terrainkit_robots.analysis.inertia.physical import MAX_INERTIA, MIN_INERTIA
from terrainkit_robots.description.fix import Part
from terrainkit_robots.description.model import Link
from terrainkit_robots.transforms import Matrix


def mass_part(link: Link) -> Part:
    """Return the part of a link with its mass, or the link itself without one."""
    return Part(link.name, (link.inertial or link).source)


def inertia_part(link: Link) -> Part:
    """Return the part of a link with its inertia, or the link itself without one."""
    source = link.inertial and link.inertial.inertia_source
    return Part(link.name, source) if source else mass_part(link)


def main_cause(body: Body) -> Link:
    """Return the link that contributes the most to the inertia of a body with mass."""

    def trace(part: tuple[Link, float, Matrix, Matrix]) -> float:
        _, mass, pose, inertia = part
        return float(np.trace(inertia + parallel_axis(mass, pose[:3, 3] - body.center)))

    return max(body.parts(), key=trace)[0]


def because_of(cause: Link, body: Body) -> str:
    """Return which merged link causes a finding on a body; empty if it is its main link."""
    return "" if cause is body.main_link else f"; mostly due to its link {cause.name}"


def max_inertia(link: Link) -> float:
    """Return the largest absolute element of an inertia [kg m2]; 0 if there is none."""
    inertia = link.inertial.inertia if link.inertial else None
    return 0.0 if inertia is None else float(np.abs(inertia).max())


def has_valid_mass(body: Body) -> bool:
    """Return whether all masses of the body are declared, nonnegative and below the limit."""
    masses = [link.inertial.mass for link in body.links if link.inertial is not None]
    return all(mass is not None and 0 <= mass < MAX_INERTIA for mass in masses)


def bodies_with_mass(bodies: Iterable[Body]) -> Iterator[Body]:
    """Yield the bodies with a valid mass above zero, without virtual ones."""
    for body in bodies:
        if not body.virtual and has_valid_mass(body) and body.mass > MIN_INERTIA:
            yield body
