"""Return where masses, inertias, limits and losses are written."""

from terrainkit_robots.description.model import Joint, Link, Source


def mass_source(link: Link) -> Source:
    """Return where the mass of a link is written, or the link itself without one."""
    return link.inertial.source if link.inertial else link.source


def inertia_source(link: Link) -> Source:
    """Return where the inertia of a link is written, or the link itself without one."""
    if link.inertial is None:
        return link.source
    return link.inertial.inertia_source or link.inertial.source


def limit_source(joint: Joint) -> Source:
    """Return where the limits of a joint are written, or the joint itself without any."""
    return joint.limit.source if joint.limit else joint.source


def dynamics_source(joint: Joint) -> Source:
    """Return where the losses of a joint are written, or the joint itself without any."""
    return joint.dynamics.source if joint.dynamics else joint.source
