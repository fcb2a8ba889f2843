"""Rules on the episodes of a task: terminations, levels and spawns."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.task_facts import TaskFacts
from terrainkit_robots.lint.rule import Violations, rule
from terrainkit_robots.lint.rules.tsk.rewards import violation

MIN_STANDING = 0.25
"""Time that a statue lasts [s]: a free fall of 0.3 m."""

MAX_DEPTH, MAX_DROP = 0.01, 1.0
"""Largest depth of the lowest point below the ground after a reset [m], which contacts push out,
and largest height above it, relative to the height of the base: Gymnasium's Ant has 0.6."""


def _rises(task: TaskFacts, behavior: str) -> NDArray[Any]:
    """Return the changes of the levels in an episode.

    Raises:
        CannotCheckError: if there are no levels.
    """
    rises = task.rollout(behavior).rises
    if rises is None:
        raise CannotCheckError(task.missing.get("levels", "the task has no levels"))
    return rises


@rule("TSK011", "statue-terminated", "error")
def statue_terminated(task: TaskFacts) -> Violations:
    """Robots with zero action are terminated at once.

    Nothing is learned in episodes of a few steps. A limit of the termination is within the default
    pose, or a foot is among the bodies that end an episode.

    Fix:
        Compare the limits of the terminations with the default pose and the spawn height.

    Source:
        A quarter of a second, in which a free fall is 0.3 m.
    """
    statue = task.rollout("statue")
    seconds = np.median(statue.running.sum(axis=0) * task.dt)
    if statue.terminated.mean() > 0.5 and seconds < MIN_STANDING:
        share = f"{statue.terminated.mean():.0%} of the robots are terminated after"
        limit = f"expected at least {MIN_STANDING:g} s"
        yield violation(task, "statue", f"{share} {seconds:.2f} s with zero action; {limit}")


@rule("TSK012", "fall-goes-on", "warning")
def fall_goes_on(task: TaskFacts) -> Violations:
    """No termination ends the episode of a robot that lies on its side.

    Robots learn from long episodes on the ground, and earn what is paid for living there.

    Fix:
        Terminate on the tilt of the base, or on contacts of the trunk.

    Source:
        Robots that start on their side, with zero action.
    """
    fall = task.rollout("fall")
    if not fall.terminated.any():
        lasting = f"{len(fall.running) * task.dt:.3g} s"
        yield violation(task, "fall", f"no robot that lies on its side is terminated in {lasting}")


@rule("TSK013", "statue-rises", "error")
def statue_rises(task: TaskFacts) -> Violations:
    """Robots with zero action rise a level.

    The curriculum does not measure what is to be learned, and ends at its hardest level without it.

    Fix:
        Let levels depend on the distance along the command, not on rewards or time.

    Source:
        A full episode with commands to move.
    """
    share = float((_rises(task, "statue") > 0).mean())
    if share:
        yield violation(task, "statue", f"{share:.0%} of the robots with zero action rise a level")


@rule("TSK014", "levels-stuck", "warning")
def levels_stuck(task: TaskFacts) -> Violations:
    """Robots that move exactly as commanded do not rise a level.

    No policy can rise: the episode is too short, the commands too slow, or the patches too long.

    Fix:
        Lengthen the episodes, command higher speeds, or reduce the distance that rises.

    Source:
        A full episode on the easiest levels, without obstacles.
    """
    if not (_rises(task, "moving") > 0).any():
        yield violation(task, "moving", "no robot that moves as commanded rises a level")


@rule("TSK015", "spawn-height", "error")
def spawn_height(task: TaskFacts) -> Violations:
    """Robots start inside the ground, or far above it.

    Contacts throw them out of the ground, and a drop ends many episodes before the first action
    counts.

    Fix:
        Correct the spawn height, or the heights of the spawn origins.

    Source:
        Lowest point of the collision shapes after a reset. Contacts push out 1 cm without harm.
    """
    clearance = task.value("clearance")
    drop, limit = np.median(clearance), MAX_DROP * task.value("base_height")
    if below := int((clearance < -MAX_DEPTH).sum()):
        robots = f"{below} of {len(clearance)} robots start in the ground"
        depth = f"up to {-100 * clearance.min():.1f} cm deep; the limit is {100 * MAX_DEPTH:g} cm"
        yield violation(task, "spawn", f"{robots}, {depth}")
    elif drop > limit:
        above = f"robots start {100 * drop:.0f} cm above the ground"
        yield violation(task, "spawn", f"{above}; the limit is {100 * limit:.0f} cm")
