"""The smoke test: whether a robot can be trained at all, in seconds, before a night is spent on it.

Each check is a function that measures one thing. What it measures is judged against what every
robot that was ever trained well has: feet on the ground at the start, rewards that tell something,
a default pose in which it stands.
"""

import gc
import tempfile
import tracemalloc
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from numpy.typing import NDArray

from terrainkit.errors import ConfigError, TerrainkitError
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.rl import registry
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.events import sample_reset_state
from terrainkit_robots.rl.rewards import Reward
from terrainkit_robots.rl.runner import LeggedRunner, single_torch_thread
from terrainkit_robots.rl.scene import Robot, lowest_point
from terrainkit_robots.rl.state import State
from terrainkit_robots.rl.task import Rewards, Task
from terrainkit_robots.rl.terrain import Plane, Terrain

if TYPE_CHECKING:
    from terrainkit_robots.lint.settings import Settings

FloatArray = NDArray[np.float32]

ROBOTS = 16
"""Environments of a smoke test."""

_HIGH, _DEEP = 0.02, 0.001
"""Most that a foot may be above and below the ground when an episode starts [m]."""

_SUNK = 0.5
"""Part of its height above which a robot that stands has its base."""

_RANDOM_STEPS, _WARM_STEPS, _MEMORY_STEPS = 100, 10, 60
"""Steps with random actions: whose rewards are looked at, before memory is, and while it is."""

_MOST_KEPT, _GROWTH = 0.1, 1.0
"""Most memory that may be kept from `_MEMORY_STEPS`, and most that the process may grow [MB]: the
states and observations of 16 robots, kept, are 1 MB."""

_LOOKS = 3
"""How often memory is looked at before it is said to grow."""

_ITERATIONS = 3
"""Updates of a policy."""


@dataclass(frozen=True, kw_only=True)
class Check:
    """Something that was looked at."""

    name: str
    """What it is called."""

    passed: bool
    """Whether it is as wanted."""

    measured: str
    """What was found."""

    wanted: str
    """What has to be found."""


@dataclass(frozen=True, kw_only=True)
class Smoke:
    """What a smoke test found."""

    robot: str
    """Name of the robot."""

    checks: tuple[Check, ...]
    """What was looked at, in order; what could not be reached is left out."""

    @property
    def passed(self) -> bool:
        """Whether everything is as wanted."""
        return all(check.passed for check in self.checks)


def smoke(robot: Robot, task: Task, ground: Terrain) -> Smoke:
    """Return whether a robot can be trained for a task on a ground.

    Args:
        robot: The robot.
        task: Its task; of its numbers of environments and updates a few are enough.
        ground: What it stands on.
    """
    parts = min(task.algorithm.num_mini_batches, ROBOTS)
    small = replace(
        task,
        env=replace(task.env, num_envs=ROBOTS, num_threads=1),
        algorithm=replace(task.algorithm, num_mini_batches=parts),
    )
    with single_torch_thread():
        try:
            env, still = LeggedEnv(small, robot, ground), LeggedEnv(_still(small), robot, ground)
        except TerrainkitError as error:
            return Smoke(robot=robot.spec.name, checks=(_initialised(str(error)),))
        checks = [_initialised(""), spawn_height(still), *observation_shapes(env), stands(still)]
        checks += rewards(env)
        checks += [memory(env), training(env)]
    return Smoke(robot=robot.spec.name, checks=tuple(checks))


def smoke_of(name: str, *, settings: "Settings | None" = None, spec: Path | None = None) -> Smoke:
    """Return whether a robot can be trained for its task, on a plane.

    Args:
        name: A URDF, xacro or MJCF file, which is onboarded first, into a folder that is gone
            afterwards; an onboarded folder; or a registered robot.
        settings: Packages, xacro arguments and rules that are not asked, of a file.
        spec: A robot.toml whose values go before what would be suggested, of a file.

    Raises:
        TerrainkitError: if there is no such robot, or its files cannot be read or trained.
    """
    if not _is_file(name):
        if spec is not None:
            raise ConfigError(f"a spec for {name}, which has one; wanted it for a robot's file")
        found = registry.find(name)
        return smoke(Robot.load(found.folder), found.task, Plane())
    from terrainkit_robots.onboarding.pipeline import Wishes, bring_in, keeps_out

    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "robot"
        wishes = Wishes(target=target, spec=spec, pictures=False)
        done = bring_in(Path(name), replace(wishes, settings=settings or wishes.settings))
        errors = list(filter(keeps_out, done.report.findings))
        if done.folder is None:
            codes = ", ".join(dict.fromkeys(error.code for error in errors))
            return Smoke(
                robot=done.report.facts.model.title,
                checks=(_onboarded(f"{len(errors)} errors left: {codes}"),),
            )
        tried = smoke(Robot.load(target), Task(), Plane())
    return replace(tried, checks=(_onboarded(""), *tried.checks))


def _is_file(name: str) -> bool:
    try:
        return Path(name).is_file()
    except (OSError, ValueError) as error:
        raise ConfigError(f"cannot read {name}: {error}") from error


def _onboarded(errors: str) -> Check:
    return Check(
        name="can be onboarded",
        passed=not errors,
        measured=errors or "yes",
        wanted="no errors that make another robot of it",
    )


def record(smoke: Smoke) -> dict[str, Any]:
    """Return what a smoke test found as plain data."""
    return {
        "robot": smoke.robot,
        "verdict": "pass" if smoke.passed else "fail",
        "checks": [asdict(check) for check in smoke.checks],
    }


def _still(task: Task) -> Task:
    """Return the task of robots that start at the default pose, at rest, all alike."""
    return replace(
        task,
        terrain=replace(task.terrain, max_init_level=0),
        init_state=replace(
            task.init_state, reset_range=(1.0, 1.0), position=0.0, yaw=0.0, lin_vel=0.0, ang_vel=0.0
        ),
        domain_rand=replace(
            task.domain_rand,
            friction=None,
            added_mass=None,
            com_shift=0.0,
            gains=None,
            motor_strength=None,
            joint_offset=0.0,
            push_interval_s=0.0,
        ),
    )


def _initialised(error: str) -> Check:
    return Check(
        name="environment initialises",
        passed=not error,
        measured=error or f"{ROBOTS} robots",
        wanted="no error",
    )


def spawn_height(env: LeggedEnv) -> Check:
    """Return whether feet are on the ground when an episode starts; robots start alike."""
    gaps = _gaps(env)
    if not gaps:
        measured, passed = "no foot touches anything: none has a collision shape", False
    else:
        foot_low, low = min(gaps.items(), key=lambda item: item[1])
        foot_high, high = max(gaps.items(), key=lambda item: item[1])
        passed = low >= -_DEEP and high <= _HIGH
        measured = (
            f"{_centimeters(low)} ({foot_low}) to {_centimeters(high)} ({foot_high}) above the "
            f"ground, with spawn_height {env.robot.spec.spawn_height:.4g} m"
        )
        if missing := [name for name in env.robot.spec.feet if name not in gaps]:
            measured, passed = f"{measured}; no collision shape: {', '.join(missing)}", False
    return Check(
        name="spawn height",
        passed=passed,
        measured=measured,
        wanted=f"every foot within {_centimeters(_HIGH)} of the ground, none below",
    )


def _centimeters(length: float) -> str:
    return f"{100 * length + 0.0:.1f} cm"


def _gaps(env: LeggedEnv) -> dict[str, float]:
    """Return how far each foot is above the ground, of all robots the worst [m]."""
    import mujoco

    model, data = env.scene.model, mujoco.MjData(env.scene.model)
    gaps: dict[str, float] = {}
    # As it was drawn: an environment lifts robots that begin in the ground.
    drawn, _ = sample_reset_state(
        np.random.default_rng(0),
        env.curriculum.env_origins,
        env.scene,
        env.robot,
        env.terrain,
        env.cfg.init_state,
    )
    for qpos in drawn:
        data.qpos[:] = qpos
        with quiet_mujoco():
            mujoco.mj_kinematics(model, data)
        for foot in env.robot.spec.feet:
            first = int(model.body(foot).geomadr[0])
            geoms = range(first, first + int(model.body(foot).geomnum[0]))
            own = [
                _gap(env.terrain, model, data, geom) for geom in geoms if geom in env.scene.geoms
            ]
            if own:
                gap = min(own)
                gaps[foot] = max(gaps.get(foot, gap), gap, key=lambda g: abs(g - _HIGH / 2))
    return gaps


def _gap(ground: Terrain, model: Any, data: Any, geom: int) -> float:
    """Return how far the lowest point of a geom is above the ground under its middle [m]."""
    x, y = data.geom_xpos[geom][:2, None].astype(np.float32)
    return lowest_point(model, data, geom) - float(ground.height(x, y)[0])


def observation_shapes(env: LeggedEnv) -> list[Check]:
    """Return whether what is observed has the widths of the task's table."""
    robot, joints = env.robot, env.num_actions
    points = len(env.cfg.terrain.measured_points_x) * len(env.cfg.terrain.measured_points_y)
    widths = {
        "dof_pos": joints,
        "dof_vel": joints,
        "actions": joints,
        "joint_offset": joints,
        "height_scan": points,
        "friction": 1,
        "added_mass": 1,
        "foot_force": 3 * len(robot.spec.feet),
    }
    checks = []
    for group, observed in env.get_observations().items():
        own = {each.name: each.function(env.state).shape[1] for each in env.obs_groups[group]}
        vectors = ("commands", "projected_gravity", "base_ang_vel", "base_lin_vel", "com_shift")
        table = widths | dict.fromkeys((*vectors, "push_vel"), 3)
        wanted = sum(table.get(name, width) for name, width in own.items())
        finite = bool(torch.isfinite(observed).all())
        checks.append(
            Check(
                name=f"observation {group}",
                passed=tuple(observed.shape) == (env.num_envs, wanted) and finite,
                measured=f"{observed.shape[-1]} numbers{'' if finite else ', some not finite'}",
                wanted=f"{wanted} finite numbers ({len(own)} parts, {joints} joints)",
            )
        )
    return checks


def stands(env: LeggedEnv) -> Check:
    """Return whether robots stay up for the first second with zero action."""
    env.set_commands(np.zeros((env.num_envs, 3), np.float32))
    target = float(env.robot.spec.base_height_target or 1.0)
    fell, lowest, steps = np.inf, np.inf, round(1 / env.cfg.dt)
    for step in range(1, steps + 1):
        _, _, dones, extras = env.step(torch.zeros(env.num_envs, env.num_actions))
        if (dones & ~extras["time_outs"]).any():
            fell = step * env.cfg.dt
            break
        lowest = float(env.state.base_height.min())
    env.set_commands(None)
    if np.isfinite(fell):
        measured = f"fell after {fell:.2f} s"
    else:
        measured = f"base at {lowest:.3f} m, {100 * lowest / target:.0f} % of its height"
    return Check(
        name="stands for 1 s with zero action",
        passed=bool(np.isinf(fell)) and lowest >= _SUNK * target,
        measured=measured,
        wanted=f"no fall, and the base above {100 * _SUNK:.0f} % of {target:.3f} m",
    )


class _Recorder:
    """Keeps what a reward was, over all steps and robots."""

    def __init__(self, name: str, function: Reward) -> None:
        self.name, self.function = name, function
        self.low, self.high, self.finite = np.inf, -np.inf, True

    def __call__(self, state: State, robot: Robot, settings: Rewards) -> FloatArray:
        """Return the reward, and keep it."""
        values = self.function(state, robot, settings)
        self.finite &= bool(np.isfinite(values).all())
        self.low, self.high = min(self.low, values.min()), max(self.high, values.max())
        return values

    def check(self, possible: State, robot: Robot, settings: Rewards) -> Check:
        """Return whether it is a number, and can be another one than 0.

        Some are for what a robot may well not do in two seconds: so those that were always 0 are
        asked about states that it might come to.
        """
        measured, passed = f"{self.low:.3g} to {self.high:.3g}", self.finite
        if not self.finite:
            measured = "not finite"
        elif self.low == 0 == self.high:
            passed = bool(self.function(possible, robot, settings).any())
            measured = "0: nothing happened that it is for" if passed else "0, whatever may happen"
        return Check(
            name=f"reward {self.name}",
            passed=passed,
            measured=measured,
            wanted=f"finite, and not 0 in every state; rewards.{self.name} 0 leaves it out",
        )


def rewards(env: LeggedEnv) -> list[Check]:
    """Return whether each reward is a number, and not always 0, while robots act at random.

    One in four is asked to stand, so that what pays only there can show.
    """
    commands = env.commands.copy()
    commands[::4] = 0
    env.set_commands(commands)
    before = dict(env.rewards)
    recorders = {name: _Recorder(name, function) for name, (function, _) in before.items()}
    env.rewards.update({name: (recorders[name], scale) for name, (_, scale) in before.items()})
    try:
        _act_at_random(env, _RANDOM_STEPS)
    finally:
        env.rewards.update(before)
        env.set_commands(None)
    possible = possible_states(env.state, env.cfg.runner.seed)
    return [recorder.check(possible, env.robot, env.cfg.rewards) for recorder in recorders.values()]


def possible_states(state: State, seed: int) -> State:
    """Return states of as many robots in which anything may be the case.

    All numbers of the first robot are about 0.1, those of the last about 1000, so no robot is in
    such a state; but what is 0 in all of them is 0 in any. One in four is asked to stand.
    """
    rng = np.random.default_rng(seed)
    made: dict[str, NDArray[Any]] = {}
    for name in (field.name for field in fields(state)):
        shape, dtype = getattr(state, name).shape, getattr(state, name).dtype
        sizes = np.logspace(-1, 3, shape[0]).reshape(-1, *(1 for _ in shape[1:]))
        values = sizes * rng.normal(size=shape)
        made[name] = values > 0 if np.issubdtype(dtype, np.bool_) else values.astype(dtype)
    made["commands"][::4] = 0
    return State(**made)


def _act_at_random(env: LeggedEnv, steps: int) -> None:
    generator = torch.Generator().manual_seed(env.cfg.runner.seed)
    for _ in range(steps):
        env.step(torch.randn(env.num_envs, env.num_actions, generator=generator))


def memory(env: LeggedEnv) -> Check:
    """Return whether stepping on takes no more memory.

    What Python and numpy keep is counted to the byte. What others keep shows in the size of the
    process, which also grows once for what is not kept: so there are several looks at that.
    """
    tracing = tracemalloc.is_tracing()
    tracemalloc.start()
    try:
        _act_at_random(env, _WARM_STEPS)
        before = _kept()
        _act_at_random(env, _MEMORY_STEPS)
        kept = (_kept() - before) / 1e6
    finally:
        if not tracing:
            tracemalloc.stop()
    grown = np.inf
    for _ in range(_LOOKS):
        size = _resident()
        _act_at_random(env, _MEMORY_STEPS)
        grown = min(grown, (_resident() - size) / 1e6)
        if grown <= _GROWTH:
            break
    return Check(
        name="memory is bounded",
        passed=kept <= _MOST_KEPT and grown <= _GROWTH,
        measured=f"after {_MEMORY_STEPS} steps {max(kept, 0.0):.2f} MB are kept, and the process "
        f"is {max(grown, 0.0):.1f} MB larger",
        wanted=f"at most {_MOST_KEPT:g} MB and {_GROWTH:g} MB",
    )


def _kept() -> int:
    """Return what Python and numpy hold of what was made since they are asked [bytes]."""
    gc.collect()
    return tracemalloc.get_traced_memory()[0]


def _resident() -> int:
    """Return the memory that this process holds [bytes]."""
    import psutil

    gc.collect()
    return int(psutil.Process().memory_info().rss)


def training(env: LeggedEnv) -> Check:
    """Return whether a policy can be updated a few times."""
    losses: list[Mapping[str, float]] = []
    error = ""
    # The caller's random numbers stay as they are, and so does the verdict.
    with torch.random.fork_rng(devices=()):
        torch.manual_seed(env.cfg.runner.seed)
        runner = LeggedRunner(env)
        update = runner.alg.update

        def noted() -> Mapping[str, float]:
            losses.append(update())
            return losses[-1]

        runner.alg.update = noted
        try:
            runner.learn(_ITERATIONS)
        except TerrainkitError as refused:
            error = str(refused)
        except (RuntimeError, ValueError) as failed:  # torch, of what is not a number
            error = f"{type(failed).__name__}: {' '.join(str(failed).split())}"
    named = {name: [float(each[name]) for each in losses] for name in (losses[0] if losses else ())}
    wrong = [name for name, values in named.items() if not np.isfinite(values).all()]
    last = ", ".join(f"{name} {values[-1]:.3g}" for name, values in named.items())
    return Check(
        name=f"trains for {_ITERATIONS} iterations",
        passed=not error and not wrong and len(losses) == _ITERATIONS,
        measured=error or f"losses: {last or 'none'}",
        wanted="finite losses",
    )
