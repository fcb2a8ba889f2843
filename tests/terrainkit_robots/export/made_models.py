"""Parts of robot models, and texts of links."""

from pathlib import Path

import numpy as np

from terrainkit_robots.description.model import (
    Geometry,
    Inertial,
    Joint,
    Limit,
    Link,
    MeshFile,
    RobotModel,
    Source,
)
from terrainkit_robots.mesh.surface import Surface, binary_stl
from tests import small_robots

SOURCE = Source(file=Path("robot.urdf"), line=1)

MJCF_MASS = '<inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>'
"""Inertial of an MJCF body."""


def urdf_link(name):
    """Return the text of a URDF link of 1 kg."""
    return small_robots.link(name, inertia=".01 .01 .01 0 0 0")


def at(x, y, z, rotation=None):
    """Return a pose."""
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    if rotation is not None:
        pose[:3, :3] = rotation
    return pose


def inertial(mass, moments=(0.01, 0.01, 0.01), origin=None):
    place = np.eye(4) if origin is None else origin
    return Inertial(source=SOURCE, mass=mass, inertia=np.diag(moments).astype(float), origin=place)


def shape(kind, *size, **fields):
    return Geometry(source=SOURCE, shape=kind, size=size, **fields)


def mesh(file, /, scale=(1.0, 1.0, 1.0), **fields):
    """Return the geometry of a mesh file, which belongs to a package r."""
    name = f"package://r/{file}"
    reference = MeshFile(source=SOURCE, filename=name, path=Path(file), scale=scale)
    return shape("mesh", mesh=reference, **fields)


def link(name, mass=1.0, **fields):
    """Return a link; without a mass, it has no inertial."""
    weight = None if mass is None else inertial(mass)
    return Link(name=name, source=SOURCE, **{"inertial": weight, **fields})


def limits(lower=-1.0, upper=1.0, effort=5.0, velocity=7.0):
    return Limit(source=SOURCE, lower=lower, upper=upper, effort=effort, velocity=velocity)


def joint(name, kind, parent, child, **fields):
    """Return a joint about z with limits."""
    given = {"axis": np.array([0.0, 0, 1]), "limit": limits(), **fields}
    return Joint(name=name, source=SOURCE, kind=kind, parent=parent, child=child, **given)


def model(*parts, **fields):
    """Return the model of links and joints."""
    return RobotModel(
        name="r",
        kind="urdf",
        file=Path("robot.urdf"),
        source=SOURCE,
        links=tuple(part for part in parts if isinstance(part, Link)),
        joints=tuple(part for part in parts if isinstance(part, Joint)),
        **fields,
    )


def surface_of(made):
    """Return the surface of a trimesh."""
    return Surface(points=np.asarray(made.vertices), faces=np.asarray(made.faces))


def stl_of(made):
    """Return a trimesh as binary STL."""
    return binary_stl(surface_of(made))
