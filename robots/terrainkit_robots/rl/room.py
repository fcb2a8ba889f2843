"""The memory that training takes, known before any of it is taken."""

from terrainkit.errors import MemoryLimitError
from terrainkit.memory import check_memory
from terrainkit_robots.rl.robot import Robot
from terrainkit_robots.rl.task import Task

_DOUBLE, _FLOAT = 8, 4
"""Size of a number in the physics, and of one in observations and networks [bytes]."""

_LOOKS = 12
"""Arrays as long as an observation that looking and observing hold at a time."""

_PASSES = 5
"""Arrays as wide as a hidden layer that learning holds for it: the layer, its activation, the
gradients of both, and what is computed of them."""


def require_room(task: Task, robot: Robot, *, scan: bool, geoms: int) -> None:
    """Raise MemoryLimitError if the environments of a task do not fit in memory.

    Args:
        task: The task, with as many environments as this process has.
        robot: The robot.
        scan: Whether there is a height scan.
        geoms: Shapes in the scene; a ground of boxes has up to some thousands.
    """
    each = bytes_each(task, robot, scan=scan, geoms=geoms)
    asked = task.env.num_envs
    try:
        check_memory(asked * each, f"training with {asked} environments")
    except MemoryLimitError as error:
        while asked > 1:
            asked //= 2
            try:
                check_memory(asked * each, "")
            except MemoryLimitError:
                continue
            raise MemoryLimitError(f"{error}; env.num_envs {asked} would fit") from None
        raise


def bytes_each(task: Task, robot: Robot, *, scan: bool, geoms: int) -> int:
    """Return what training takes for each environment [bytes], within a factor of two."""
    joints, feet = len(robot.default_pose), len(robot.spec.feet)
    points = len(task.terrain.measured_points_x) * len(task.terrain.measured_points_y)
    policy = 9 + 3 * joints + scan * points
    observed = policy + policy + 11 + joints + 3 * feet  # by the policy, and by the critic
    bodies = joints + feet
    # The state twice, sensors, and what differs from robot to robot: see `apply_differences`.
    physics = 2 * (20 + 6 * bodies + 3 * joints) + 6 * 3 * feet + 7 * bodies
    physics += 3 * geoms + 20 * joints
    steps = task.runner.num_steps_per_env
    stored = steps * (observed + 3 * joints + 7)
    normalized = 3 * steps * observed
    batch = steps / task.algorithm.num_mini_batches
    if task.algorithm.symmetry != "none":
        batch *= 2
    widths = sum(task.policy.actor_hidden_dims) + sum(task.policy.critic_hidden_dims)
    learned = batch * (_PASSES * widths + 2 * observed)
    numbers = _LOOKS * observed + stored + max(normalized, learned)
    return round(_DOUBLE * physics + _FLOAT * numbers)
