"""Tell wheels from other bodies."""

import math

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.analysis.bodies.shapes import has_bounds, min_height
from terrainkit_robots.description.model import Joint
from terrainkit_robots.mesh.mesh_cache import Meshes
from terrainkit_robots.transforms import axis_angle_to_matrix

MAX_LIMITED_RANGE = 4 * np.pi
"""Range of a joint with useful limits, at most [rad]. Exporters write up to 1e16 for wheels."""

_MIN_WHEEL_RANGE = 6.2
"""Range of the joint of a wheel, at least [rad]: exporters write -3.14 to 3.14 without limits."""

_MAX_BALANCED_OFFSET = 0.1
"""Distance of the center of mass to the axis over the radius of gyration, at most, of a wheel or a
propeller. Parts of legs have more than 1."""

_MAX_RADIUS_RATIO = 1.25
"""Largest over smallest radius of a wheel about its axis. A square has 1.41, a foot 2 and more."""

_ANGLES = np.linspace(0, 2 * np.pi, 16, endpoint=False)
"""Angles about the axis at which the radius is measured [rad]."""


def turns_without_limits(joint: Joint) -> bool:
    """Return whether a joint is a hinge without limits, or with limits beyond two turns."""
    lower, upper = joint.range or (-np.inf, np.inf)
    return joint.kind != "prismatic" and bool(upper - lower > MAX_LIMITED_RANGE)


def is_balanced(body: Body) -> bool:
    """Return whether a body is balanced on its axis, as a wheel or a propeller is."""
    if body.joint is None:
        return False
    # Half of the trace is the polar second moment m r^2 of the mass about its center.
    moment = float(np.trace(body.inertia)) / 2
    if body.mass <= 0 or moment <= 0:
        return False
    arm = body.center - body.joint.anchor
    offset = float(np.linalg.norm(np.cross(arm, body.joint.direction)))
    return offset < _MAX_BALANCED_OFFSET * math.sqrt(moment / body.mass)


def is_leg_wheel(body: Body, meshes: Meshes) -> bool:
    """Return whether the last body of a leg is a wheel.

    A wheel makes a whole turn, and its collision shapes are round about the axis. The mass
    does not tell: the center of mass of a foot may be on the axis of an ankle.

    Args:
        body: A body without children, on a joint.
        meshes: Mesh files.
    """
    joint = body.joint
    assert joint is not None
    lower, upper = joint.range or (-np.inf, np.inf)
    if joint.kind == "prismatic" or upper - lower < _MIN_WHEEL_RANGE:
        return False
    shapes = [shape for shape in body.collisions if has_bounds(shape.geometry, meshes)]
    if not shapes:
        return False
    # The radius at an angle is the depth of the lowest point below the axis, which is horizontal.
    sideways = np.cross(joint.direction, np.eye(3)[np.abs(joint.direction).argmin()])
    down = sideways / np.linalg.norm(sideways)
    upright = np.array([joint.direction, np.cross(down, joint.direction), -down])
    radii = []
    for rotation in axis_angle_to_matrix(np.array([1.0, 0.0, 0.0]), _ANGLES):
        pose = np.eye(4)
        pose[:3, :3] = rotation @ upright
        pose[:3, 3] = -pose[:3, :3] @ joint.anchor
        radii.append(max(-min_height(shape, pose, meshes) for shape in shapes))
    return min(radii) > 0 and max(radii) <= _MAX_RADIUS_RATIO * min(radii)
