"""Rules on a short training."""

import numpy as np

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.task_facts import TaskFacts, Training
from terrainkit_robots.lint.rule import Violations, rule
from terrainkit_robots.lint.rules.tsk.rewards import violation

MAX_PENALTY, MAX_DROP = 2.0, 0.1
"""Limits of a penalty at the end of the training and of a drop of the reward, relative to the sum
of the positive rewards."""

MAX_DEVIATIONS, MAX_INCREASE = 3.0, 0.25
"""Limits of an increase of the falls, in standard deviations, and per robot [1/s]. Robots that
begin to step fall more often than those that stand: by up to 0.11 in 24 trainings of 8 robots
from healthy files."""


def completed_training(task: TaskFacts) -> Training:
    """Return the training of a task.

    Raises:
        CannotCheckError: if there is none, or it stopped.
    """
    training: Training = task.value("training")
    if training.error:
        raise CannotCheckError("the training stopped (TSK022)")
    return training


@rule("TSK022", "training-stops", "error")
def training_stops(task: TaskFacts) -> Violations:
    """A short training stops.

    A reward or a weight of the networks is not finite, or the algorithm does not fit the task.

    Fix:
        Reduce rewards or the learning rate, or bound what a reward divides by.

    Source:
        A training from scratch on a plane (--samples).
    """
    if error := task.value("training").error:
        yield violation(task, "training", error)


@rule("TSK023", "learns-to-fall", "error")
def learns_to_fall(task: TaskFacts) -> Violations:
    """In a short training, the reward drops, or the robots fall more often.

    Penalties that exceed the rewards teach to fall.

    Fix:
        Reduce the penalties that the table shows for random actions, and the learning rate.

    Source:
        First and last quarter of a training from scratch on a plane (--samples). In 24 trainings of
        robots from healthy files, the falls of a robot increased by at most 0.11 per second.
    """
    training = completed_training(task)
    first, last = training.rewards.sum(axis=1)
    lowest = first - MAX_DROP * np.maximum(training.rewards[0], 0).sum()
    if last < lowest:
        drop = f"the reward drops from {first:.3g} to {last:.3g} /s"
        yield violation(task, "reward", f"{drop}; the limit is {lowest:.3g} /s")
    before, after = training.falls.tolist()
    deviation = np.sqrt((before + after) / training.robot_seconds)
    limit = before + max(MAX_DEVIATIONS * deviation, MAX_INCREASE)
    if after > limit:
        increase = f"the falls of a robot increase from {before:.3g} to {after:.3g} /s"
        yield violation(task, "falls", f"{increase}; the limit is {limit:.3g} /s")


@rule("TSK024", "penalty-dominates", "error")
def penalty_dominates(task: TaskFacts) -> Violations:
    """At the end of a short training, a penalty is far larger than the positive rewards.

    Robots learn to avoid it by falling, and tracking does not show in the return. `termination` may
    be larger: it depends on how often they still fall.

    Fix:
        Reduce the scale of the term.

    Source:
        Last quarter of a training from scratch on a plane (--samples). In trainings that are known
        to learn, the largest penalty was 114 % of the positive rewards.
    """
    training = completed_training(task)
    positive = np.maximum(training.rewards[1], 0).sum() or 1.0
    for name, value in zip(training.terms, training.rewards[1].tolist(), strict=True):
        if value < -MAX_PENALTY * positive and name != "termination":
            share = f"{-value / positive:.0%} of the positive rewards"
            limit = f"the limit is {MAX_PENALTY:.0%}"
            yield violation(task, name, f"reward {name} is {value:.3g} /s, {share}; {limit}")
