"""Rules on the reward terms of a task."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit_robots.analysis.task_facts import REST, TaskFacts
from terrainkit_robots.description.fix import Part
from terrainkit_robots.lint.rule import Violation, Violations, rule

MAX_STANDING = 0.8
"""Largest share of the reward of moving as commanded that robots without progress may earn. Tasks
that are known to be learned have up to 0.73."""

MIN_SHARE = 0.1
"""Smallest difference of a term between two behaviors, relative to the positive rewards of moving
as commanded. Smaller ones do not decide what is learned."""

MAX_PENALTY = 20.0
"""Largest penalty of random actions, relative to the positive rewards of moving as commanded. That
of known tasks is up to 2."""

MIN_VARIATION = 1e-3
"""Smallest variation of a term over all behaviors, relative to its value."""

STILL = "statue", "stepping"
"""Behaviors without progress."""


def violation(task: TaskFacts, subject: str, message: str) -> Violation:
    """Return a violation of a part of a task, such as a term or a behavior."""
    return Violation(message=message, element=Part(subject, task.model.source))


def values_of(task: TaskFacts) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield each term with its values in all rollouts, of which one has random states."""
    task.rollout("scattered")
    values = [rollout.rewards.reshape(-1, len(task.terms)) for rollout in task.rollouts.values()]
    yield from zip(task.terms, np.concatenate(values).T, strict=True)


def paid(task: TaskFacts, behavior: str) -> str:
    """Return what a behavior earns, and its largest term."""
    means = task.rollout(behavior).means
    largest = int(np.abs(means).argmax())
    total = f"{behavior} earns {means.sum():.3g}"
    return f"{total} (most of it {task.terms[largest]} {means[largest]:.3g})"


@rule("TSK001", "not-finite", "error")
def not_finite(task: TaskFacts) -> Violations:
    """A reward or an observation is not finite.

    One value that is infinite or not a number spreads to all weights in the first update.

    Fix:
        Bound what is divided by, and the arguments of roots, logarithms and exponentials.

    Source:
        Rollouts of all behaviors, of which some are far from any healthy state.
    """
    for name, values in values_of(task):
        if not np.isfinite(values).all():
            count = int((~np.isfinite(values)).sum())
            yield violation(task, name, f"reward {name} is not finite in {count} steps")
    for behavior, rollout in task.rollouts.items():
        wrong = ~np.isfinite(rollout.observations).all(axis=(0, 1))
        for name in dict.fromkeys(np.array(task.observation_names)[wrong].tolist()):
            yield violation(task, name, f"observation {name} is not finite for {behavior}")


@rule("TSK002", "zero-reward", "warning")
def zero_reward(task: TaskFacts) -> Violations:
    """A reward term is always 0.

    No behavior changes it, not even random states: its bodies, joints or conditions do not exist,
    and it teaches nothing.

    Fix:
        Name the bodies or joints that the term is about, or set its scale to 0.

    Source:
        Rollouts of all behaviors, with states beyond the limits of the joints.
    """
    for name, values in values_of(task):
        if name not in ("termination", REST) and not values.any():
            yield violation(task, name, f"reward {name} is 0 in all {len(values)} steps")


@rule("TSK003", "constant-reward", "note")
def constant_reward(task: TaskFacts) -> Violations:
    """A reward term is constant.

    All behaviors earn the same, so that it teaches nothing but to live: a kernel is too wide, or a
    value is clipped.

    Fix:
        Narrow the kernel to the errors that matter, or leave the term out.

    Source:
        Rollouts of all behaviors: the term varies by less than a thousandth of its value.
    """
    for name, values in values_of(task):
        if values.any() and np.ptp(values) <= MIN_VARIATION * abs(values.mean()):
            yield violation(task, name, f"reward {name} is {values.mean():.3g} in every step")


@rule("TSK004", "inverted-reward", "error")
def inverted_reward(task: TaskFacts) -> Violations:
    """A reward term pays for random actions or for lying.

    It is higher than for standing and for moving as commanded. Usually, a penalty has a positive
    scale.

    Fix:
        Change the sign of the scale, or of the term.

    Source:
        Means of the rollouts; differences below a tenth of the positive rewards do not count.
    """
    good = np.maximum(task.rollout("moving").means, task.rollout("statue").means)
    for name in ("random", "fall"):
        means = task.rollout(name).means
        excess = means - np.maximum(good, 0)
        for k in np.flatnonzero(excess > MIN_SHARE * task.positive()):
            what = f"reward {task.terms[k]} is {means[k]:.3g} for {name}"
            better = f"{good[k]:.3g} for standing and moving as commanded"
            yield violation(task, task.terms[k], f"{what}, and at most {better}")


@rule("TSK005", "large-penalty", "error")
def large_penalty(task: TaskFacts) -> Violations:
    """A penalty is far larger than what moving as commanded earns.

    The policy first learns to avoid it by not moving, and tracking does not show in the return.

    Fix:
        Reduce the scale of the term, until random actions cost as much as tracking pays.

    Source:
        Random actions of the first standard deviation. Tasks that are known to be learned have
        penalties up to twice the positive rewards.
    """
    means, positive = task.rollout("random").means, task.positive()
    for k in np.flatnonzero(means < -MAX_PENALTY * positive):
        what = f"reward {task.terms[k]} is {means[k]:.3g} for random actions"
        share = f"{-means[k] / positive:.0f} times what moving as commanded earns"
        yield violation(task, task.terms[k], f"{what}, {share}; the limit is {MAX_PENALTY:.0f}")


@rule("TSK006", "standing-pays", "warning")
def standing_pays(task: TaskFacts) -> Violations:
    """Robots without progress earn almost as much as robots that move as commanded.

    What is left for moving is less than the noise of the return and the risk of a fall, so that
    policies learn to stand, or to step in place.

    Fix:
        Pay more for tracking, narrow its kernel, and multiply what standing earns by the progress.

    Source:
        Commands to move. Tasks that are known to be learned pay at most 73 % for standing.
    """
    best = task.total("moving")
    for name in filter(task.rollouts.__contains__, STILL):
        if MAX_STANDING * best < task.total(name) < best:
            share = f"{task.total(name) / best:.0%} of {best:.3g} for moving as commanded"
            limit = f"the limit is {MAX_STANDING:.0%}"
            yield violation(task, name, f"{paid(task, name)}, {share}; {limit}")


@rule("TSK007", "worse-pays-more", "error")
def worse_pays_more(task: TaskFacts) -> Violations:
    """Standing, stepping in place or lying earns more than moving as commanded.

    The optimum of the task is not to move.

    Fix:
        Compare the columns of the table: the terms in which the worse behavior is better.

    Source:
        Means per second of robots that are commanded to move.
    """
    for name in filter(task.rollouts.__contains__, (*STILL, "fall")):
        if task.total(name) > task.total("moving"):
            yield violation(task, name, f"{paid(task, name)}, and {paid(task, 'moving')}")


@rule("TSK008", "falling-pays", "error")
def falling_pays(task: TaskFacts) -> Violations:
    """Robots that stand or move as commanded have a negative reward.

    The sooner an episode ends, the less it costs, so that policies learn to fall.

    Fix:
        Reduce the penalties, or add a reward for being upright.

    Source:
        Means per second; without terminations, the rule does not apply.
    """
    best = task.total("moving")
    for name in ("statue", "moving"):
        if task.total(name) < -MIN_SHARE * abs(best) and task.rollout("fall").terminated.any():
            yield violation(task, name, f"{paid(task, name)}; a fall ends the penalties")


@rule("TSK009", "term-pays-standing", "warning")
def term_pays_standing(task: TaskFacts) -> Violations:
    """A positive term pays more for standing than for moving as commanded.

    It works against tracking. Kernels of errors times speed, such as a foot clearance, have their
    maximum at rest.

    Fix:
        Multiply the term by the speed or the progress, or pay it only for a foot in the air.

    Source:
        Commands to move; differences below a tenth of the positive rewards do not count.
    """
    still, moving = task.rollout("statue").means, task.rollout("moving").means
    difference = np.maximum(still, 0) - np.maximum(moving, 0)
    for k in np.flatnonzero(difference > MIN_SHARE * task.positive()):
        values = f"{still[k]:.3g} for a statue, and {moving[k]:.3g} for moving as commanded"
        yield violation(task, task.terms[k], f"reward {task.terms[k]} is {values}")


@rule("TSK010", "climbing-costs", "error")
def climbing_costs(task: TaskFacts) -> Violations:
    """On the hardest level, moving as commanded earns no more than standing.

    The penalties of a step exceed what tracking pays for it, so that policies stop before it.

    Fix:
        Reduce the penalties that rise on the level, such as vertical velocity and base height.

    Source:
        The base moves at the height of the ground, without impacts, so that real costs are higher.
    """
    if task.total("climbing") <= task.total("staying"):
        costs = task.rollout("moving").means - task.rollout("climbing").means
        worst = f"{task.terms[int(costs.argmax())]} costs {costs.max():.3g} more than on average"
        both = f"{paid(task, 'climbing')}, and {paid(task, 'staying')}"
        yield violation(task, "climbing", f"{both}; {worst}")
