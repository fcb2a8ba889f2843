"""Check a robot for its training: environment, actions, rewards, and a short training."""

import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np
import torch

from terrainkit.errors import TerrainkitError
from terrainkit_robots.description.robot_file import is_description
from terrainkit_robots.lint.rule import rules
from terrainkit_robots.onboarding.onboard_options import OnboardOptions
from terrainkit_robots.onboarding.pipeline import onboard
from terrainkit_robots.policy.evaluate import eval_task
from terrainkit_robots.policy.load_policy import single_torch_thread
from terrainkit_robots.policy.policy_rollout import Progress
from terrainkit_robots.policy.result_table import ResultTable
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.rl.config import Task
from terrainkit_robots.rl.env import LeggedEnv, make_env
from terrainkit_robots.rl.run import PolicySpec
from terrainkit_robots.rl.tasks import default_task, get_task
from terrainkit_robots.rl.terrain import Plane
from terrainkit_robots.simulation.geoms import lowest_point
from terrainkit_robots.simulation.step_response import MAX_RISE_TIME, step_responses
from terrainkit_robots.smoke_test.short_training import TrainingRecord, train_briefly
from terrainkit_robots.spec.robot_arrays import Robot
from terrainkit_robots.task_check.check import check_task
from terrainkit_robots.task_check.hosts.terrainkit_host import TerrainkitHost
from terrainkit_robots.text import count, group, names

MAX_FOOT_HEIGHT, MAX_FOOT_DEPTH, MIN_BASE_HEIGHT = 0.02, 0.001, 0.5
"""Limits of the lowest foot above and below the ground [m], and of the base, relative to its
target."""

MAX_FOOT_SPREAD = 0.05
"""Limit of the other feet above the lowest one, relative to the length of a leg: a trunk that
stands tilted by 2 degrees."""

STAND = "stands with zero action"
"""Name of the check of standing."""

NUM_ENVS = 16
"""Number of robots."""

DEFAULT_SAMPLES, MIN_TREND_SAMPLES = 100_000, 50_000
"""Samples of the short training, and the fewest that show whether a robot learns."""

MAX_PENALTY, MAX_DROP = 2.0, 0.1
"""Limits of a penalty at the end of the training and of a drop of the reward, relative to the sum
of the positive rewards."""

MAX_DEVIATIONS, MAX_INCREASE = 3.0, 0.25
"""Limits of an increase of the falls, in standard deviations, and per robot [1/s]. Robots that
begin to step fall more often than those that stand: by up to 0.11 in 24 trainings of 8 robots
from healthy files."""


@dataclass(frozen=True)
class Check:
    """One check: its name, whether it passed, and what was measured and expected."""

    name: str
    passed: bool
    measured: str
    expected: str


def make_result(robot: str, *checks: Check) -> ResultTable[Check]:
    """Return the checks of a robot; a failure may end the test early."""
    return ResultTable(about={"robot": robot}, tables={"checks": checks}, schema_version=2)


def smoke_test(
    name: str,
    options: OnboardOptions | None = None,
    *,
    samples: int = DEFAULT_SAMPLES,
    seed: int = 1,
    progress: Progress = lambda _: None,
) -> ResultTable[Check]:
    """Check whether a robot can be trained for its task on a plane.

    Args:
        name: A registered robot, an onboarded folder, or a URDF, xacro or MJCF file or a name of
            robot_descriptions, which are onboarded into a temporary folder.
        options: Options for onboarding a file.
        samples: Samples of the short training; 0 for none. With fewer than `MIN_TREND_SAMPLES`,
            only the losses are checked.
        seed: Seed of the random numbers of the training.
        progress: Called after each iteration of the training.

    Raises:
        TerrainkitError: If the robot does not exist or cannot be read.
    """
    if not (Path(name).is_file() or is_description(name)):
        found = get_task(name)
        task = with_seed(found.task, seed)
        return run_checks(Robot.load(found.folder), task, samples, progress)
    options = replace(options or OnboardOptions(), render_images=False)
    with tempfile.TemporaryDirectory() as folder:
        onboarded = onboard(name, Path(folder) / "robot", options)
        codes = [finding.code for finding in onboarded.report.findings if finding.is_blocking]
        measured = f"{len(codes)} errors: {', '.join(dict.fromkeys(codes))}" if codes else "yes"
        passed = onboarded.folder is not None
        check = Check("can be onboarded", passed, measured, "no errors that change the robot")
        if onboarded.folder is None:
            return make_result(onboarded.report.facts.model.title, check)
        robot = Robot.load(onboarded.folder)
        task = with_seed(default_task(robot.spec), seed)
        result = run_checks(robot, task, samples, progress)
    checks = {check.name: check for check in (check, *result["checks"])}
    if onboarded.unjudged:
        checks[STAND] = replace(checks[STAND], passed=False, measured=onboarded.unjudged)
    return make_result(robot.spec.name, *checks.values())


def with_seed(task: Task, seed: int) -> Task:
    """Return a task with other random numbers."""
    return replace(task, runner=replace(task.runner, seed=seed))


@single_torch_thread()
def run_checks(
    robot: Robot, task: Task, samples: int, progress: Progress = lambda _: None
) -> ResultTable[Check]:
    """Check whether a robot can be trained for a task on a plane; see `smoke_test`."""
    name = "environment initializes"
    expected = "no error"
    task = replace(task, commands=replace(task.commands, waypoints=False))  # a plane has no goals
    algorithm = replace(task.algorithm, num_mini_batches=1)  # a few robots allow no more
    env_cfg = replace(task.env, num_envs=NUM_ENVS, num_threads=1)
    try:
        make_env(replace(task, env=env_cfg, algorithm=algorithm), robot, Plane())
        still_env = make_env(eval_task(task, NUM_ENVS), robot, Plane())
    except TerrainkitError as error:
        return make_result(robot.spec.name, Check(name, False, str(error), expected))
    record = train_briefly(robot, task, samples, progress) if samples else None
    trained = record if record and not record.error and samples >= MIN_TREND_SAMPLES else None
    checks = (
        Check(name, True, f"{NUM_ENVS} robots", expected),
        check_spawn_height(still_env),
        check_stand(still_env),
        check_step_responses(still_env),
        *check_rules(task, robot),
        *([check_training(record)] if record else []),
        *(check_penalties(trained.last_rewards) if trained else []),
        *(check_trends(trained) if trained else []),
    )
    return make_result(robot.spec.name, *checks)


def check_spawn_height(env: LeggedEnv) -> Check:
    """Check that the feet of the default pose are on the ground at the spawn height."""
    model, spec, scene = env.scene.model, env.robot.spec, env.scene
    data = mujoco.MjData(model)
    data.qpos[:] = scene.default_qpos
    data.qpos[2] = spec.spawn_height or 0.0
    with quiet_mujoco():
        mujoco.mj_kinematics(model, data)
    heights, measured = [], []
    for foot in spec.feet:
        geoms = scene.geoms[model.geom_bodyid[scene.geoms] == model.body(foot).id]
        height = min((lowest_point(model, data, int(geom)) for geom in geoms), default=np.nan)
        heights.append(height)
        distance = f"{100 * height + 0.0:.1f} cm" if len(geoms) else "has no shape"
        measured.append(f"{foot} {distance}")
    above = f"{', '.join(measured)} above the ground, with spawn_height {spec.spawn_height:.4g} m"
    spread = MAX_FOOT_SPREAD * (spec.leg_length or 0.4)
    passed = True  # a robot without feet
    if heights:
        # False without a shape, whose height is not a number.
        lowest, highest = np.min(heights), np.max(heights)
        passed = -MAX_FOOT_DEPTH <= lowest <= MAX_FOOT_HEIGHT and highest <= lowest + spread
    expected = (
        f"the lowest foot within {100 * MAX_FOOT_HEIGHT:.1f} cm of the ground, none below, and the "
        f"others at most {100 * spread:.1f} cm higher"
    )
    return Check("spawn height", bool(passed), above, expected)


def check_stand(env: LeggedEnv) -> Check:
    """Check that the robots stand for one second with zero action, on two legs for half of it."""
    seconds = 0.5 if len(env.robot.spec.feet) == 2 else 1.0  # without balance, a biped tips over
    env.set_commands(np.zeros((env.num_envs, 3), np.float32))
    target, dt = env.robot.base_height_target, env.cfg.dt
    for step in range(round(seconds / dt)):
        _, _, dones, extras = env.step(torch.zeros(env.num_envs, env.num_actions))
        height = float(env.state.base_height.min())
        measured = f"base at {height:.3f} m, {100 * height / target:.0f} % of its height"
        passed = height >= MIN_BASE_HEIGHT * target
        if (dones & ~extras["time_outs"]).any():
            passed, measured = False, f"fell after {(step + 1) * dt:.2f} s"
            break
    expected = f"no fall for {seconds:g} s, and the base above {MIN_BASE_HEIGHT * target:.3f} m"
    return Check(STAND, passed, measured, expected)


def check_step_responses(env: LeggedEnv) -> Check:
    """Check that each joint that the policy moves follows a step of its target."""
    order = env.robot.spec.joint_order
    moved = {name for name, scale in zip(order, env.actions.scale, strict=True) if scale}
    responses = step_responses(env.scene.model, env.scene.default_qpos)
    failed = [f"{r.joint} {r.failure}" for r in responses if r.joint in moved and r.failure]
    measured = names(failed, max_count=3) or f"{count(len(moved), 'joint')} follow"
    expected = f"{MAX_RISE_TIME:g} s for 90 % of a step, with the base held"
    return Check("joints follow their targets", not failed, measured, expected)


def check_rules(task: Task, robot: Robot) -> Iterator[Check]:
    """Check the task with the rules of check-task. Notes do not fail."""
    host = TerrainkitHost(PolicySpec(task=task, robot=robot), Plane(), Path(robot.spec.name))
    report = check_task(host)
    found = group((f.code, f.message) for f in report.findings if f.severity != "note")
    skipped = {skip.code for skip in report.skipped}
    for rule in rules("task"):
        messages = found.get(rule.code, [])
        measured, name = "; ".join(messages) or "nothing found", f"{rule.code} {rule.name}"
        if rule.code not in skipped:
            yield Check(name, not messages, measured, rule.page.how_to_fix)


def check_penalties(rewards: Mapping[str, float]) -> Iterator[Check]:
    """Check that no penalty is far larger than the positive rewards, or robots learn to fall.

    `termination` may be: it depends on how often they still fall.

    Args:
        rewards: Mean of each term at the end of a training [1/s].
    """
    positive = sum(max(value, 0) for value in rewards.values()) or 1.0
    for name, value in rewards.items():
        if value < 0 and name != "termination":
            measured = f"{value:+.3f} /s, {-value / positive:.0%} of the positive rewards"
            passed = -value <= MAX_PENALTY * positive
            yield Check(f"penalty {name}", passed, measured, f"at most {MAX_PENALTY:.0%}")


def check_training(record: TrainingRecord) -> Check:
    """Check that a training has finite losses."""
    last = dict(record.losses[-1] if record.losses else {}, noise_std=record.noise_std)
    values = [list(loss.values()) for loss in record.losses]
    passed = not record.error and bool(np.isfinite([*np.ravel(values), record.noise_std]).all())
    measured = ", ".join(f"{name.replace('_', ' ')} {value:.3g}" for name, value in last.items())
    name = f"trains for {count(len(record.losses), 'iteration')}"
    return Check(name, passed, record.error or measured, "finite losses and noise")


def check_trends(record: TrainingRecord) -> Iterator[Check]:
    """Check that from the first to the last quarter of a training, robots do not learn to fall."""
    first, last = sum(record.first_rewards.values()), sum(record.last_rewards.values())
    drop = MAX_DROP * sum(max(value, 0) for value in record.first_rewards.values())
    measured = f"{first:.2f} to {last:.2f} /s"
    expected = f"at least {first - drop:.2f} /s in the last quarter of the training"
    yield Check("reward does not drop", last >= first - drop, measured, expected)
    before, after = record.falls
    deviation = np.sqrt((before + after) / record.robot_seconds)
    limit = before + max(MAX_DEVIATIONS * deviation, MAX_INCREASE)
    measured = f"{before:.3f} to {after:.3f} falls/s per robot"
    expected = f"at most {limit:.3f}; penalties that exceed the rewards teach to fall"
    yield Check("falls do not increase", bool(after <= limit), measured, expected)
