"""Check whether the mass of a body fits its size."""

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.bounds import BodyBounds
from terrainkit_robots.analysis.bodies.shapes import has_bounds, volume
from terrainkit_robots.description.model import Geometry, Link
from terrainkit_robots.mesh.mesh_cache import MeshError, Meshes
from terrainkit_robots.transforms import Matrix

# 12 of 536 published files are outside, such as 4 kg in 31 cm3 and virtual links of 10 g.
MIN_DENSITY, MAX_DENSITY = 10.0, 20_000.0
"""Densities of the lightest packing foam and of gold [kg/m3]. The collision shapes of drones, which
are mostly air, have 20."""

_PLAUSIBLE_DENSITY = 200.0
"""If the bounding box of a body has at least this density, its volume is not computed [kg/m3]."""

_DEFAULT_DENSITY = 1000.0
"""Density that MuJoCo assigns to the collision shapes of links without <inertial> [kg/m3]."""

_SLENDERNESS = 20.0
"""Cubed length over volume of a rather slender limb."""


def has_derived_mass(body: Body) -> bool:
    """Return whether MuJoCo derives the mass from the shapes, so that the two always agree."""
    return all(link.inertial is None or link.inertial.source == link.source for link in body.links)


def check_max_density(body: Body, body_bounds: BodyBounds) -> tuple[float, float] | None:
    """Return the volume of the bounding box [m3] and MAX_DENSITY if a body is too heavy for it."""
    box = body_bounds.box_if(body, lambda box: body.mass > MAX_DENSITY * _box_volume(box))
    return None if box is None or _box_volume(box) <= 0 else (_box_volume(box), MAX_DENSITY)


def check_min_density(
    body: Body, body_bounds: BodyBounds, meshes: Meshes
) -> tuple[float, float] | None:
    """Return the volume of the largest shape [m3] and MIN_DENSITY if a body is too light for it."""

    def needs_volume(length: float) -> bool:
        return body.mass < _PLAUSIBLE_DENSITY * length**3 / _SLENDERNESS

    # The volume of a mesh is expensive, and a body that is dense enough for its box is dense enough
    # for its shapes.
    box = body_bounds.shape_box(body, needs_volume)
    if box is None or body.mass >= _PLAUSIBLE_DENSITY * _box_volume(box):
        return None
    shapes = (*body.collisions, *body.visuals)
    largest = max(shape_volume(shape.geometry, meshes) for shape in shapes)
    return (largest, MIN_DENSITY) if body.mass < MIN_DENSITY * largest else None


def default_mass(link: Link, meshes: Meshes) -> float:
    """Return the mass that MuJoCo infers for a link without <inertial> [kg]."""
    return _DEFAULT_DENSITY * sum(shape_volume(shape, meshes) for shape in link.collisions)


def _box_volume(box: Matrix) -> float:
    return float(np.prod(box[1] - box[0]))


def shape_volume(shape: Geometry, meshes: Meshes) -> float:
    """Return the volume of a shape [m3], or 0 if it is unknown."""
    if not has_bounds(shape, meshes):
        return 0.0
    try:
        return max(0.0, volume(shape, meshes))
    except (MeshError, ValueError):
        return 0.0
