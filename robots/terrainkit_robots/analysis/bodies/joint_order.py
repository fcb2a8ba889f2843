"""Joint order: the places at which one list of joints has those of another.

A permutation p is one for arrays: `theirs = ours[p]`, so p[i] is the place in our order of what is
at place i in theirs.
"""

from collections.abc import Sequence

from terrainkit_robots.analysis.facts import Facts


def tree_order(robot: Facts) -> tuple[str, ...]:
    """Return the joints with one degree of freedom as the tree has them, which is MuJoCo's order.

    Depth first, siblings in the order of the file.
    """
    return tuple(joint.name for joint in robot.joints)


def actuator_order(robot: Facts) -> tuple[str, ...]:
    """Return the joints in the order of the first actuator on each; none without actuators."""
    known = {joint.name for joint in robot.joints}
    driven = (actuator.joint for actuator in robot.model.actuators)
    return tuple(dict.fromkeys(name for name in driven if name in known))


def permutation(ours: Sequence[str], theirs: Sequence[str]) -> list[int] | None:
    """Return p such that theirs[i] is ours[p[i]]; None unless both have the same names, once."""
    place = {name: index for index, name in enumerate(ours)}
    if len(place) != len(ours) or len(ours) != len(theirs) or set(theirs) != set(place):
        return None
    return [place[name] for name in theirs]


def is_moved(places: Sequence[int]) -> bool:
    """Return whether a permutation changes anything."""
    return list(places) != sorted(places)
