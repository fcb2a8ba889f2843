"""Fix invalid inertias."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.shapes import bounds
from terrainkit_robots.analysis.inertia.physical import (
    MIN_INERTIA,
    box_inertia,
    gyration_radius,
    is_zero,
    nearest_physical,
    principal_moments,
    triangle_ratio,
)
from terrainkit_robots.analysis.symmetry.mirror import Mirror
from terrainkit_robots.description.fix import Edit, Fix, RemoveAttribute, SetAttribute
from terrainkit_robots.description.model import Inertial, Link
from terrainkit_robots.description.xml.number_text import number_text
from terrainkit_robots.mesh.mesh_cache import Meshes
from terrainkit_robots.transforms import Matrix

_MAX_MASS_DIFFERENCE = 0.2
"""Relative difference of masses up to which a link takes the inertia of its mirror image, which is
scaled by the ratio of the masses."""

_MAX_SAME_MASS = 0.02
"""The same difference up to which it is not scaled."""

_ATTRIBUTES = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")


@dataclass(frozen=True, kw_only=True, eq=False)
class InertiaRepair:
    """Fixes of invalid inertias, from the mirrored link, the inertia itself or the shapes."""

    bodies: Sequence[Body]
    mirror: Mirror
    meshes: Meshes

    def fix(self, link: Link) -> Fix | None:
        """Return the edits that give a link a physical inertia; None if there are none.

        The first inertia that exists is taken, in this order: the inertia of the mirror image, the
        physical inertia nearest to the declared one, the inertia of a solid box around the body.
        """
        inertial = link.inertial
        if inertial is None or inertial.inertia is None:
            return None
        source = inertial.inertia_source or inertial.source
        if source.element is None or source == link.source:
            return None  # it cannot be edited, or MuJoCo derived it
        inertia, description = self._repaired(link, inertial, inertial.inertia)
        if inertia is None:
            return None
        return Fix(
            safety="unsafe",
            description=f"Replace the inertia of link {link.name} by {description}.",
            edits=tuple(_edits(inertial, inertia)),
        )

    def relative_change(self, link: Link) -> float:
        """Return how much the fix of a link changes the inertia of its body.

        Returns:
            The largest change of a moment over the smallest principal moment of the body; infinite
            if there is no fix, or the inertia of the body itself is invalid.
        """
        inertial = link.inertial
        if inertial is None or inertial.inertia is None or link.name not in self._location:
            return np.inf
        inertia, _ = self._repaired(link, inertial, inertial.inertia)
        smallest = float(self._location[link.name][0].principal[0])
        if inertia is None or not smallest > MIN_INERTIA:
            return np.inf
        # The spectral norm of a symmetric matrix is the largest change of a moment about any axis.
        return float(np.linalg.norm(inertia - inertial.inertia, 2)) / smallest

    def _repaired(
        self, link: Link, inertial: Inertial, declared: Matrix
    ) -> tuple[Matrix | None, str]:
        """Return a physical inertia in the inertial frame of a link, and what it is."""
        # The mirror image is the same part with valid numbers. The nearest inertia keeps the axes
        # and most of what is declared. The box knows no more than the size and the mass.
        mirrored, image = self._mirror_inertia(link)
        candidates = (
            (mirrored, f"the inertia of its mirror image {image}"),
            (self._nearest(link, declared), "the nearest physical inertia"),
            (self._solid_box(link, inertial), "the inertia of a solid box around the body"),
        )
        return next((candidate for candidate in candidates if candidate[0] is not None), (None, ""))

    @cached_property
    def _location(self) -> Mapping[str, tuple[Body, int]]:
        """The body of each link, and the index of the link in it."""
        return {
            link.name: (body, index)
            for body in self.bodies
            for index, link in enumerate(body.links)
        }

    def _mirror_inertia(self, link: Link) -> tuple[Matrix | None, str]:
        """Return the mirrored inertia in the inertial frame of a link, and of which link it is.

        None if it is not physical, or the masses differ.
        """
        if link.name not in self._location:
            return None, ""
        body, index = self._location[link.name]
        other_index = self.mirror.image_index.get(body.index)
        # Links have no mirror images of their own: they correspond by their place in the body.
        if other_index is None or len(self.bodies[other_index].links) != len(body.links):
            return None, ""
        other = self.bodies[other_index].links[index]
        mass, other_mass = _mass(link), _mass(other)
        if other.inertial is None or other.inertial.inertia is None or not other_mass > 0:
            return None, ""
        inertia, moments = other.inertial.inertia, principal_moments(other.inertial.inertia)
        if moments[0] <= 0 or triangle_ratio(moments) < 1:
            return None, ""
        if abs(mass - other_mass) > _MAX_MASS_DIFFERENCE * other_mass:
            return None, ""
        # From the other inertial frame to the trunk, mirrored, and to the own inertial frame.
        transform = self._axes(link).T @ self.mirror.reflection @ self._axes(other)
        difference = abs(mass - other_mass) / other_mass
        scale = mass / other_mass if difference > _MAX_SAME_MASS else 1.0
        image = other.name if scale == 1.0 else f"{other.name}, times {scale:.3g} as its mass is"
        return np.asarray(scale * (transform @ inertia @ transform.T)), image

    def _axes(self, link: Link) -> Matrix:
        """Return the axes of a link's inertial frame in the frame of the trunk, shape (3, 3)."""
        body, index = self._location[link.name]
        assert link.inertial is not None
        pose = body.zero_pose @ body.poses[index] @ link.inertial.origin
        return np.asarray(pose[:3, :3])

    def _nearest(self, link: Link, inertia: Matrix) -> Matrix | None:
        """Return the nearest physical inertia, unless the body is too small for it.

        If one of the six elements is far too large, so is the nearest physical inertia.
        """
        if is_zero(inertia):
            return None
        nearest = nearest_physical(inertia)
        box = self._box(link)
        mass = _mass(link)
        if nearest is None or box is None or not mass > 0:
            return nearest
        radius = gyration_radius(principal_moments(nearest), mass)
        # No mass inside the box is farther from its center than half of the diagonal, and the
        # radius of gyration is an average of distances.
        return nearest if radius <= np.linalg.norm(box[1] - box[0]) / 2 else None

    def _solid_box(self, link: Link, inertial: Inertial) -> Matrix | None:
        """Return the inertia of a box around the body of a link, in the inertial frame."""
        box = self._box(link)
        if box is None or (box[1] - box[0]).min() <= 0 or not _mass(link) > 0:
            return None
        body, index = self._location[link.name]
        rotation = (body.poses[index] @ inertial.origin)[:3, :3]
        return np.asarray(rotation.T @ box_inertia(_mass(link), box[1] - box[0]) @ rotation)

    def _box(self, link: Link) -> Matrix | None:
        if link.name not in self._location:
            return None
        body, _ = self._location[link.name]
        return bounds(body.collisions or body.visuals, self.meshes)


def _mass(link: Link) -> float:
    return (link.inertial.mass if link.inertial else None) or 0.0


def _edits(inertial: Inertial, inertia: Matrix) -> Iterator[Edit]:
    """Yield the edits that write an inertia that is given in the inertial frame."""
    source = inertial.inertia_source or inertial.source
    numbers = _format(inertia)
    off_diagonal = inertia - np.diag(np.diag(inertia))
    # Rotations between frames leave rounding errors of 1e-16 of the largest element.
    is_diagonal = np.abs(off_diagonal).max() <= 1e-12 * np.abs(inertia).max()
    if not inertial.attribute:
        for name, number in zip(_ATTRIBUTES, numbers, strict=True):
            yield SetAttribute(source=source, name=name, value=number)
    elif inertial.attribute == "diaginertia" and is_diagonal:
        yield SetAttribute(source=source, name="diaginertia", value=" ".join(numbers[:3]))
    else:  # fullinertia excludes attributes for its orientation
        rotation = inertial.origin[:3, :3]
        full = " ".join(_format(rotation @ inertia @ rotation.T))
        yield SetAttribute(source=source, name="fullinertia", value=full)
        for name in (inertial.attribute, inertial.axes_attribute):
            if name not in ("", "fullinertia"):
                yield RemoveAttribute(source=source, name=name)


def _format(inertia: Matrix) -> list[str]:
    """Return the six elements in the order of `_ATTRIBUTES`."""
    elements = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    return [number_text(inertia[element]) for element in elements]
