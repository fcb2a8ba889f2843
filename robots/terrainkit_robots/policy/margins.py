"""The margins of a policy: what it bears of latency, pushes and errors of model and sensors."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit_robots.policy.evaluate import EvaluationConfig, build_eval_env, commands_at
from terrainkit_robots.policy.load_policy import load_policy, single_torch_thread
from terrainkit_robots.policy.metrics import RolloutMetrics
from terrainkit_robots.policy.policy_rollout import EvaluationRollout, Progress
from terrainkit_robots.policy.result_table import ResultTable
from terrainkit_robots.rl.config import Commands
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.events import EventTerm, apply_params, push_interval, reset_push
from terrainkit_robots.rl.run import PolicySpec
from terrainkit_robots.rl.simulation import Ids
from terrainkit_robots.rl.terrain import Plane
from terrainkit_robots.transforms import FloatArray, quat_rotate_inverse

DEFAULT_REPETITIONS = 3
"""Robots for each command."""

PUSH_INTERVAL = 2.0
"""Time between pushes [s]."""

NOTE = (
    "m/s: error of the velocity averaged over 1 s. swing: lowest of the mean swing heights of the "
    "feet. Torque and joint speed: largest share of the limits, and in parentheses the 95th "
    "percentile. Foot force: the largest, in multiples of the robot's weight."
)
"""What the columns of the table are."""

COMMANDS = (1, 0, 0), (0.5, 0, 0), (-0.5, 0, 0), (0, 1, 0), (0, 0, -1), (0.5, 0, 0.5), (0, 0, 0)
"""Commands as fractions of the limits of the task."""


@dataclass(frozen=True)
class Disturbance:
    """A quantity of the simulation that differs from its nominal value."""

    unit: str
    """Unit of the values; x for a factor."""

    values: tuple[float, ...]
    """Values that are measured, each alone: on each side of the nominal value, the nearest first.
    """

    nominal: float
    """Value without the disturbance; NaN for the robot's own."""

    observation: str = ""
    """Observation that the policy must have for the disturbance to matter."""


DISTURBANCES = {
    "latency": Disturbance("ms", (10, 20, 30, 40, 50, 60), 0),
    "push": Disturbance("m/s", (0.5, 1.0, 1.5, 2.0), 0),
    "friction": Disturbance("", (0.8, 0.6, 0.4, 0.3, 0.2, 0.1), np.nan),
    "mass": Disturbance("x", (0.9, 0.8, 1.1, 1.2, 1.3, 1.4), 1),
    "motor strength": Disturbance("x", (0.9, 0.8, 0.7, 1.1, 1.2, 1.3), 1),
    "stiffness": Disturbance("x", (0.7, 1.3), 1),
    "damping": Disturbance("x", (0.5, 2.0), 1),
    "IMU tilt": Disturbance("deg", (1, 2, 5), 0),
    "velocity bias": Disturbance("m/s", (0.1, 0.2), 0, "base_lin_vel"),
    "velocity noise": Disturbance("m/s", (0.3,), 0, "base_lin_vel"),
    "velocity estimate": Disturbance("x", (0.0,), 1, "base_lin_vel"),
}
"""What is measured, by name."""


def first_falls(margins: Sequence[RolloutMetrics]) -> list[RolloutMetrics]:
    """Return the smallest disturbance with falls on each side of its nominal value."""
    found: dict[tuple[Any, bool], RolloutMetrics] = {}
    for margin in margins:
        if margin.falls:
            is_more = margin.unit == "x" and (margin.value or 0) > 1
            found.setdefault((margin.condition, is_more), margin)
    return list(found.values())


def margin_rows(margins: Sequence[RolloutMetrics]) -> list[tuple[str, ...]]:
    """Return the margins as rows of text with a header."""
    head = f"fell of {margins[0].robots}", "m/s", "followed", "swing [cm]", "steps/s"
    loads = ("torque", "joint speed", "foot force")
    first = first_falls(margins)
    rows: list[tuple[str, ...]] = [("condition", *head, *loads, "")]
    for margin in margins:
        value = "" if margin.value is None else f"{margin.value:g}"
        amount = f"x {value}" if margin.unit == "x" else f"{value} {margin.unit or ''}"
        swings = [100 * height for height in margin.swing_height or () if height is not None]
        numbers = (
            _text(margin.lin_vel_error_1s, ".3f"),
            _text(margin.followed, ".0%"),
            _text(min(swings, default=None), ".1f"),
            _text(margin.step_frequency, ".1f"),
        )
        mark = "<- first falls" if margin in first else ""
        label = f"{margin.condition} {amount}".rstrip()
        rows.append((label, str(margin.falls), *numbers, *margin.load_cells(), mark))
    return rows


def _text(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)


@single_torch_thread()
def measure_margins(
    spec: PolicySpec,
    config: EvaluationConfig | None = None,
    repetitions: int = DEFAULT_REPETITIONS,
    progress: Progress = lambda _: None,
) -> ResultTable[RolloutMetrics]:
    """Measure a policy on a plane with disturbances, one at a time.

    All robots are simulated together, some with each value of a disturbance. The same seed gives
    the same result.

    Args:
        spec: The policy, such as a run.
        config: Duration, seed and device; None for the defaults.
        repetitions: Robots for each command.
        progress: Called after each step with the completed fraction, 0 to 1.

    Returns:
        The table `margins` has the metrics with each disturbance, the nominal ones first;
        `left_out` in its remarks has the disturbances that cannot be simulated, and why.

    Raises:
        ConfigError: If a run has no policy, or its policy is for another robot.
        MemoryLimitError: If the simulations would not fit in memory.
    """
    config = config or EvaluationConfig()
    conditions, left_out = _conditions(build_eval_env(spec, Plane(), 1, config))
    commands = margin_commands(spec.task.commands)
    robots = np.repeat(np.arange(len(conditions)), repetitions * len(commands))
    values = {
        name: np.array(
            [
                key["value"] if key["condition"] == name else disturbance.nominal
                for key in conditions
            ]
        )[robots]
        for name, disturbance in DISTURBANCES.items()
    }
    randomization = {
        "action_delay": (0.0, 0.001 * max(DISTURBANCES["latency"].values)),
        "push_interval_s": PUSH_INTERVAL,
        "max_push_vel_xy": max(DISTURBANCES["push"].values),
    }
    env = build_eval_env(spec, Plane(), len(robots), config, randomization)
    _disturb(env, values, np.random.default_rng(config.seed))
    env.reset()
    rollout = EvaluationRollout(env)
    repeated = np.tile(commands, (len(conditions) * repetitions, 1))
    rollout.run(load_policy(spec, env), config.seconds, repeated, progress)
    margins = [rollout.metrics(robots == k, **key) for k, key in enumerate(conditions)]
    about = {
        "robot": spec.robot.spec.name,
        "checkpoint": spec.policy_name,
        "seed": config.seed,
        "seconds": config.seconds,
        "commands": commands.tolist(),
        "repetitions": repetitions,
    }
    return ResultTable(about=about, tables={"margins": margins}, remarks={"left_out": left_out})


def margin_commands(commands: Commands) -> FloatArray:
    """Return the `COMMANDS` of a task, without repetitions, shape (k, 3)."""
    values = commands_at(commands, COMMANDS).tolist()
    return np.array(list(dict.fromkeys(map(tuple, values))), np.float32)


def _conditions(env: LeggedEnv) -> tuple[list[dict[str, Any]], tuple[str, ...]]:
    """Return the fields of `RolloutMetrics` of each condition, and which are left out and why."""
    conditions: list[dict[str, Any]] = [{"condition": "nominal"}]
    base = float(env.scene.model.body_mass[env.scene.base])
    step = 1000 * env.cfg.sim.dt
    left_out = []
    for name, disturbance in DISTURBANCES.items():
        values = disturbance.values
        if disturbance.observation and disturbance.observation not in env.obs_terms["policy"]:
            continue
        if name == "latency":  # a number of physics steps
            steps = dict.fromkeys(max(1, round(value / step)) for value in values)
            values = tuple(round(count * step, 6) for count in steps)
        if name == "mass":
            light = [value for value in values if base + (value - 1) * env.mass <= 0]
            got = f"the base weighs {base:.3g} of {env.mass:.3g} kg"
            left_out += [f"mass x {value:g}: {got}" for value in light]
            values = tuple(value for value in values if value not in light)
        keys = {"condition": name, "unit": disturbance.unit}
        conditions += [{**keys, "value": float(value)} for value in values]
    return conditions, tuple(left_out)


def _disturb(
    env: LeggedEnv, values: Mapping[str, NDArray[np.float64]], rng: np.random.Generator
) -> None:
    """Disturb the robots of an environment.

    Args:
        env: The environment.
        values: Value of each disturbance for each robot, shape (n,).
        rng: Generator of the directions.
    """
    at = {name: array[:, None].astype(np.float32) for name, array in values.items()}
    params = env.params
    friction = at["friction"]
    env.params = replace(
        params,
        geom_friction=np.where(np.isnan(friction), params.geom_friction, friction),
        added_mass=np.float32(env.mass) * (at["mass"] - 1),
        stiffness=params.stiffness * at["stiffness"],
        damping=params.damping * at["damping"],
        strength=at["motor strength"],
    )
    apply_params(env.sim, env.params)

    def directions() -> FloatArray:
        """Return horizontal unit vectors, shape (n, 3)."""
        angle = rng.uniform(-np.pi, np.pi, env.num_envs)
        return np.column_stack([np.cos(angle), np.sin(angle), 0 * angle]).astype(np.float32)

    def push(env: LeggedEnv) -> None:
        env.steps_until_push -= 1
        due = env.steps_until_push <= 0
        env.steps_until_push[due] = push_interval(env)
        env.push_vel[:] = directions() * at["push"] * due[:, None]
        env.sim.qvel[:, :2] += env.push_vel[:, :2]

    def reset_delay(env: LeggedEnv, env_ids: Ids) -> None:
        delay, ctrl = values["latency"][env_ids] / 1000, env.to_ctrl(env.action_history[0])[env_ids]
        env.sim.reset_action_delay(env_ids, delay, ctrl)

    env.active_events["push"] = EventTerm(reset=reset_push, step=push)
    env.active_events["action_delay"] = EventTerm(reset=reset_delay)
    half_tilt, bias = np.deg2rad(at["IMU tilt"]) / 2, at["velocity bias"] * directions()
    mounting = np.hstack([np.cos(half_tilt), np.sin(half_tilt) * directions()])

    def tilt(value: FloatArray) -> FloatArray:
        return quat_rotate_inverse(mounting, value)

    def estimate(value: FloatArray) -> FloatArray:
        noise = rng.uniform(-1, 1, value.shape).astype(np.float32)
        return value * at["velocity estimate"] + bias + at["velocity noise"] * noise

    terms = env.obs_terms["policy"]
    changes = {"projected_gravity": tilt, "base_ang_vel": tilt, "base_lin_vel": estimate}
    for name in changes.keys() & terms.keys():
        terms[name] = replace(terms[name], function=_changed(terms[name].function, changes[name]))


def _changed(
    measure: Callable[[LeggedEnv], FloatArray], change: Callable[[FloatArray], FloatArray]
) -> Callable[[LeggedEnv], FloatArray]:
    return lambda env: change(measure(env))
