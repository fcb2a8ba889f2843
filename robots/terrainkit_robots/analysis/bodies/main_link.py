"""The link that stands for a body, and where its mass and inertia are written."""

from terrainkit_robots.analysis.bodies.bodies import Body
from terrainkit_robots.description.model import Link, Source


def main_link(body: Body) -> Link:
    """Return the link that stands for a body: the one with the most mass."""
    name = body.name
    return next(link for link in body.links if link.name == name)


def mass_source(link: Link) -> Source:
    """Return where the mass of a link is written; the link itself, without one."""
    return link.inertial.source if link.inertial else link.source


def inertia_source(link: Link) -> Source:
    """Return where the inertia of a link is written; the link itself, without one."""
    if link.inertial is None:
        return link.source
    return link.inertial.inertia_source or link.inertial.source
