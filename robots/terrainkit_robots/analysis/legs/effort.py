"""Compute the effort limits of joints."""

from terrainkit_robots.description.model import Joint, RobotModel


def effort_limit(model: RobotModel, joint: Joint) -> float | None:
    """Return the effort limit of a joint [N m] or [N]. None if it is unlimited.

    In MJCF this is the sum of the limits of the actuators on the joint, or the limit of the joint
    if that is lower.
    """
    limit = joint.limit.effort if joint.limit else None
    if model.kind != "mjcf":
        return limit
    efforts = [motor.effort for motor in model.actuators if motor.joint == joint.name]
    known = [effort for effort in efforts if effort is not None]
    actuated = sum(known) if efforts and len(known) == len(efforts) else None
    return min((effort for effort in (actuated, limit) if effort is not None), default=None)
