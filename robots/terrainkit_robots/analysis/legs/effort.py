"""Effort: what the motors of a joint can give."""

from terrainkit_robots.analysis.cached_fact import per_robot
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.model import Joint


def effort_of(robot: Facts, joint: Joint) -> float | None:
    """Return what the motors of a joint can give [N m] or [N]; None if it is not limited."""
    limited = joint.limit.effort if joint.limit else None
    if robot.model.kind != "mjcf":
        return limited
    both = [effort for effort in (_driven(robot).get(joint.name), limited) if effort is not None]
    return min(both, default=None)


@per_robot
def _driven(robot: Facts) -> dict[str, float | None]:
    """Return the sum of the efforts of the motors on each joint; None if one is not limited."""
    efforts: dict[str, float | None] = {}
    for motor in robot.model.actuators:
        so_far, more = efforts.get(motor.joint, 0.0), motor.effort
        efforts[motor.joint] = None if so_far is None or more is None else so_far + more
    return efforts
