"""Rules on what a policy observes, commands and moves."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit_robots.analysis.task_facts import TaskFacts
from terrainkit_robots.lint.rule import Violations, rule
from terrainkit_robots.lint.rules.tsk.rewards import violation
from terrainkit_robots.text import names

MAX_OBSERVATION = 10.0
"""Largest root mean square of an observation. Networks expect about 1."""

HEALTHY = "statue", "random", "moving"
"""Behaviors in which observations have the scale of a training."""


def _numbers(task: TaskFacts, behaviors: Iterable[str]) -> NDArray[Any]:
    """Return the observations of some behaviors, shape (m, w)."""
    values = (task.rollouts[name].observations for name in behaviors if name in task.rollouts)
    return np.concatenate([value.reshape(-1, value.shape[2]) for value in values])


@rule("TSK016", "constant-observation", "warning")
def constant_observation(task: TaskFacts) -> Violations:
    """An observation is constant.

    No behavior changes it, not even random states, so that the policy cannot use it.

    Fix:
        Correct the scale, the index or the sensor of the observation, or leave it out.

    Source:
        Rollouts of all behaviors, without noise.
    """
    task.rollout("scattered")
    varies = np.ptp(_numbers(task, task.rollouts), axis=0) > 0
    varying = set(np.array(task.observation_names)[varies].tolist())
    for name in dict.fromkeys(task.observation_names):
        if name not in varying:
            yield violation(task, name, f"observation {name} never changes")


@rule("TSK017", "large-observation", "warning")
def large_observation(task: TaskFacts) -> Violations:
    """An observation is much larger than the others.

    The first layer is dominated by it, and the others are learned last.

    Fix:
        Scale it, clip it, or normalize the observations in the training.

    Source:
        Root mean square over standing, random actions and moving as commanded. Networks expect 1.
    """
    size = np.sqrt(np.square(_numbers(task, HEALTHY)).mean(axis=0))
    wrong = size > MAX_OBSERVATION
    if wrong.any():
        which = names(dict.fromkeys(np.array(task.observation_names)[wrong].tolist()))
        count = f"{wrong.sum()} of {len(size)} observations are up to {size.max():.3g}"
        yield violation(task, which, f"{count} ({which}); the limit is {MAX_OBSERVATION:g}")


@rule("TSK018", "action-range", "warning")
def action_range(task: TaskFacts) -> Violations:
    """Actions cannot reach the default pose, or random ones leave the limits.

    Motors saturate and joints hit their stops in most steps, so that actions do not change what
    the robot does.

    Fix:
        Reduce the action scale or the first standard deviation, or move the default pose.

    Source:
        Targets at one standard deviation, which a third of the actions exceed, and the torque of
        an action of 1 at the default pose.
    """
    targets, (lower, upper) = task.value("targets"), task.value("limits")
    default = (targets[1] < lower - 1e-6) | (targets[1] > upper + 1e-6)
    both = (targets.min(axis=0) < lower) & (targets.max(axis=0) > upper)
    torque = task.value("action_torque")
    largest = f"{torque.max(initial=0):.2g} times the effort"
    checks = (
        (default, "the default pose is beyond the limits"),
        (both, "targets of both standard deviations are beyond the limits"),
        (torque > 1, f"an action of 1 asks for up to {largest}"),
    )
    for wrong, what in checks:
        if wrong.any():
            which = names(np.array(task.joints)[wrong].tolist())
            yield violation(task, which, f"{what} of {which}")


@rule("TSK019", "asymmetric", "note")
def asymmetric(task: TaskFacts) -> Violations:
    """Left and right are not mirror images.

    The gait limps, and symmetry cannot be used to learn faster.

    Fix:
        Mirror the default pose, the gains and the action scales.

    Source:
        Mirror maps of joints, feet and observations.
    """
    if difference := task.value("asymmetry"):
        yield violation(task, "symmetry", difference)


@rule("TSK020", "commands", "error")
def commands(task: TaskFacts) -> Violations:
    """Commands to move are never sampled, or are faster than the motors.

    Policies learn to stand where no command asks for more, and no policy tracks a command that the
    joints cannot follow.

    Fix:
        Reduce the norm below which commands are 0, or the ranges.

    Source:
        1000 commands. A leg that turns at the speed limit of the joints moves the foot at its
        length times that speed.
    """
    sampled, limit = task.value("commands"), task.max_speed or np.inf
    speed = np.hypot(sampled[:, 0], sampled[:, 1]).max()
    if not sampled.any():
        yield violation(task, "commands", f"all {len(sampled)} sampled commands are 0")
    if speed > limit:
        feet = f"the joints move a foot at {limit:.3g} m/s"
        yield violation(task, "commands", f"commands are up to {speed:.3g} m/s; {feet}")


@rule("TSK021", "joints-follow", "warning")
def joints_follow(task: TaskFacts) -> Violations:
    """A joint does not follow a step of its target.

    Actions of a policy change a gait only if the joint gets there within the step: the gains, the
    damping or the effort of the task are too far from the inertia of the leg.

    Fix:
        Raise the stiffness or the effort, or reduce the damping; `terrainkit onboard` derives them.

    Source:
        Steps of 0.2 rad or 2 cm with the base held. Legs of published robots reach 90 % of a step
        in 0.19 s, and the limit is 0.3 s; a gait has half a second. Soft servos of robots
        that walk exceed it, such as those of the Berkeley Humanoid.
    """
    failures = task.value("responses")
    failed = [f"{name} {failures[name]}" for name in task.joints if failures.get(name)]
    if failed:
        yield violation(task, "joints", names(failed, max_count=3))
