"""Return where the mass and the inertia of a link are written."""

from terrainkit_robots.description.model import Link, Source


def mass_source(link: Link) -> Source:
    """Return where the mass of a link is written, or the link itself without one."""
    return link.inertial.source if link.inertial else link.source


def inertia_source(link: Link) -> Source:
    """Return where the inertia of a link is written, or the link itself without one."""
    if link.inertial is None:
        return link.source
    return link.inertial.inertia_source or link.inertial.source
