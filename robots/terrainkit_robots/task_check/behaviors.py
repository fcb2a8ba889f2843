"""Behaviors: short rollouts whose reward is known to be high or low before any training."""

import numpy as np

from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.task_facts import Rollout, TaskFacts, TaskModel
from terrainkit_robots.description.fix import Source
from terrainkit_robots.task_check.host import Array, Host, Motion, Progress, Step

JOINT_SCATTER, SPEED_SCATTER, BASE_SCATTER = 0.5, 30.0, 3.0
"""Standard deviations of scattered positions [rad] and velocities [rad/s] of the joints, which
cross most limits, and of velocities of the base [m/s, rad/s]."""

# A base does not jump at a riser.
WINDOW, SMOOTHING = np.linspace(-0.4, 0.4, 9), 0.1
"""Points of the ground along the heading whose mean carries a moving base [m], and the time
constant of its height [s]."""

MOVED = "moving", "climbing", "stepping"
"""Behaviors without forces."""


def measure_task(
    host: Host, progress: Progress = lambda _: None, samples: int | None = None
) -> TaskFacts:
    """Return the facts of a task: a rollout of each behavior that its host supports.

    Args:
        host: The environment.
        progress: Called with a text at each behavior and each iteration of the training.
        samples: Samples of a short training; None for none.
    """
    facts = dict(host.facts)
    if samples:
        facts["training"] = host.train(samples, progress)
    rollouts, missing = {}, dict(host.missing)
    for name in host.behaviors:
        progress(f"behavior {name}")
        try:
            if name not in missing:
                rollouts[name] = roll(host, name)
        except CannotCheckError as error:
            missing[name] = str(error)
    if "clearance" not in missing:
        host.reset("statue")
        facts["clearance"] = host.clearance()
        facts["base_height"] = float(host.default_qpos[host.height])
    name = host.file.name
    return TaskFacts(
        model=TaskModel(name, name, host.file, Source(file=host.file, line=0)),
        host=host.name,
        dt=host.dt,
        terms=host.terms,
        observation_names=host.observation_names,
        rollouts=rollouts,
        missing=missing,
        **facts,
    )


def roll(host: Host, behavior: str) -> Rollout:
    """Return a rollout of a behavior.

    `statue` has the action 0, and `random` actions of the first standard deviation. The base of
    `moving` moves exactly as commanded, and that of `stepping` stays while the feet follow the
    gait. `fall` begins on a side. `scattered` has random states. `staying` and `climbing` are a
    statue and a moving base on the hardest level, and `policy` is the trained policy.

    Raises:
        CannotCheckError: if the host does not support it.
    """
    rng, actions = np.random.default_rng(1), np.zeros((host.num_envs, host.num_actions))
    host.reset(behavior)
    levels = None if host.levels is None else host.levels.copy()
    rises, terminated, ended = np.zeros((3, host.num_envs))
    steps: list[Step] = []
    running = []
    start = host.qpos() if behavior == "scattered" else np.zeros(0)
    path = MotionPath(host, is_moving=behavior != "stepping") if behavior in MOVED else None
    if behavior == "fall":
        host.set_state(*lying(host))
    while len(steps) < host.steps and (levels is None or not ended.all()):
        if behavior in ("random", "scattered"):
            actions = host.std * rng.normal(size=actions.shape)
        if behavior == "scattered":
            host.set_state(*scattered(host, start, rng))
        elif behavior == "policy":
            actions = host.policy()
        motion = path.next_motion() if path else None
        step = host.step(actions, motion)
        first = step.done & (ended == 0)
        terminated[first] = step.terminated[first]
        if levels is not None and host.levels is not None:
            rises[first] = (host.levels - levels)[first]
        ended[first] = 1
        running.append(ended == 0)
        steps.append(step)
    return Rollout(
        rewards=np.array([step.rewards for step in steps]),
        observations=np.array([step.observations for step in steps]),
        running=np.array(running),
        terminated=terminated > 0,
        rises=None if levels is None else rises,
    )


class MotionPath:
    """The path of n bases that move exactly as commanded, or stay.

    Args:
        host: The environment, after a reset.
        is_moving: Whether the bases move.
    """

    def __init__(self, host: Host, *, is_moving: bool) -> None:
        self._host, self._is_moving = host, is_moving
        start = host.qpos()
        self._xy = start[:, :2]
        self._yaw = np.zeros(len(start))
        if host.height == 2:
            self._yaw += 2 * np.arctan2(start[:, 6], start[:, 3])
        self._ground: Array | None = None

    def next_motion(self) -> Motion:
        """Return the state after the next step."""
        host = self._host
        forward, left, turn = host.commands.T * self._is_moving
        heading = np.stack([np.cos(self._yaw), np.sin(self._yaw)], axis=1)
        aside = heading[:, ::-1] * [-1, 1]
        velocity = forward[:, None] * heading + left[:, None] * aside
        self._xy = self._xy + host.dt * velocity
        self._yaw = self._yaw + host.dt * turn
        along = self._xy[:, None] + WINDOW[:, None] * heading[:, None]
        ground = host.ground(along).mean(axis=1)
        last = ground if self._ground is None else self._ground
        self._ground = last + min(1.0, host.dt / SMOOTHING) * (ground - last)
        qpos = np.tile(host.default_qpos, (len(ground), 1))
        qvel = np.zeros((len(ground), host.model.nv))
        qpos[:, host.height] += self._ground
        qpos[:, 0], qvel[:, 0] = self._xy[:, 0], velocity[:, 0]
        qvel[:, host.height] = (self._ground - last) / host.dt
        if host.height == 2:
            qpos[:, 1], qvel[:, 1], qvel[:, 5] = self._xy[:, 1], velocity[:, 1], turn
            qpos[:, 3:7] = 0
            qpos[:, 3], qpos[:, 6] = np.cos(self._yaw / 2), np.sin(self._yaw / 2)
        return Motion(qpos, qvel)


def lying(host: Host) -> Motion:
    """Return robots that were turned onto a side, or forward where the base moves in a plane."""
    qpos = host.qpos()
    if host.height == 2:
        qpos[:, 3:7] = np.sqrt([0.5, 0.5, 0, 0])
    else:
        qpos[:, 2] += np.pi / 2
    return Motion(qpos, np.zeros((len(qpos), host.model.nv)))


def scattered(host: Host, start: Array, rng: np.random.Generator) -> Motion:
    """Return random states, which reach the penalties that healthy behaviors do not.

    Args:
        host: The environment.
        start: Positions after the reset, shape (n, nq); bases are between these and the ground.
        rng: Generator of the random numbers.
    """
    qpos = start.copy()
    qpos[:, host.height] -= host.default_qpos[host.height] * rng.random(len(qpos))
    joints = host.model.nv - 3 * host.height  # after 6 speeds of a free base, or 3 in a plane
    scatter = rng.normal(size=(len(qpos), joints))
    qpos[:, -joints:] = host.default_qpos[-joints:] + JOINT_SCATTER * scatter
    qvel = SPEED_SCATTER * rng.normal(size=(len(qpos), host.model.nv))
    qvel[:, :-joints] *= BASE_SCATTER / SPEED_SCATTER
    return Motion(qpos, qvel)
