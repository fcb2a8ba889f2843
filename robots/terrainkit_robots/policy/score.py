"""The score: how some robots did in their trials, and what that says of the policy."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from terrainkit_robots.policy.trials import SETTLING, Outcome
from terrainkit_robots.rl.env import LeggedEnv

if TYPE_CHECKING:
    from terrainkit_robots.policy.evaluate import Asked
    from terrainkit_robots.rl.run import Run

FloatArray = NDArray[np.float32]


@dataclass(frozen=True, kw_only=True)
class Score:
    """How some robots did.

    Errors are means over their steps before they fell, and None where they never walked long enough
    to be measured.
    """

    robots: int
    """How many they are."""

    falls: int
    """How many of them fell."""

    success: float | None
    """Part of them that crossed half a patch, or came half as far as they were asked to without a
    fall; None on a plane, which has no patches."""

    lin_vel_error: float | None
    """Distance between the horizontal velocity asked for and that of each instant [m/s]."""

    lin_vel_error_1s: float | None
    """The same for velocities averaged over a second, in which swaying cancels out [m/s]."""

    ang_vel_error: float | None
    """Difference between the turning speed asked for and that of each instant [rad/s]."""

    ang_vel_error_1s: float | None
    """The same for turning speeds averaged over a second [rad/s]."""


@dataclass(frozen=True, kw_only=True)
class Part:
    """Some of the robots, by what they have in common, and how they did."""

    command: tuple[float, float, float] | None = None
    """The command that they had."""

    terrain: str | None = None
    """The terrain that they started on."""

    level: int | None = None
    """The level that they started on."""

    score: Score
    """How they did."""

    def as_dict(self) -> dict[str, Any]:
        """Return what they have in common and their score, in one."""
        shared = {"command": self.command, "terrain": self.terrain, "level": self.level}
        return {k: v for k, v in shared.items() if v is not None} | asdict(self.score)


@dataclass(frozen=True, kw_only=True)
class Evaluation:
    """How a policy did."""

    robot: str
    """Name of the robot."""

    checkpoint: str
    """Name of the file with the policy."""

    terrain: str
    """Ground, as it was given."""

    seconds: float
    """How long robots walked [s]."""

    seed: int
    """Start of all random numbers."""

    whole: Score
    """All robots."""

    by_command: tuple[Part, ...] = ()
    """On a plane, robots by command."""

    by_terrain: tuple[Part, ...] = ()
    """On a map, robots by terrain."""

    by_level: tuple[Part, ...] = ()
    """On a map, robots by level."""

    by_terrain_and_level: tuple[Part, ...] = ()
    """On a map, robots by both."""

    def as_json(self) -> str:
        """Return it as JSON, which is the same for the same evaluation."""
        tables = ("by_command", "by_terrain", "by_level", "by_terrain_and_level")
        about = {
            "robot": self.robot,
            "checkpoint": self.checkpoint,
            "terrain": self.terrain,
            "seconds": self.seconds,
            "settling_seconds": SETTLING,
            "seed": self.seed,
            "all": asdict(self.whole),
        }
        parts = {table: [part.as_dict() for part in getattr(self, table)] for table in tables}
        return json.dumps(about | {k: v for k, v in parts.items() if v}, indent=2) + "\n"


def score_of(outcome: Outcome, who: NDArray[np.bool_], *, patches: bool) -> Score:
    """Return how some of the robots did; each counts alike, however long it was measured.

    Args:
        outcome: How all of them did.
        who: Which of them, shape (n,).
        patches: Whether they were on a map.
    """
    errors: list[float | None] = []
    for total, count in zip(outcome.sums[:, who], outcome.counts[:, who], strict=True):
        known = count > 0
        errors.append(float((total[known] / count[known]).mean()) if known.any() else None)
    return Score(
        robots=int(who.sum()),
        falls=int(outcome.fell[who].sum()),
        success=float(outcome.success[who].mean()) if patches else None,
        lin_vel_error=errors[0],
        lin_vel_error_1s=errors[1],
        ang_vel_error=errors[2],
        ang_vel_error_1s=errors[3],
    )


def summed_up(
    run: "Run",
    asked: "Asked",
    env: LeggedEnv,
    outcome: Outcome,
    commands: FloatArray | None = None,
) -> Evaluation:
    """Return an evaluation; commands as they are to be told apart, shape (n, 3)."""
    patches = not env.terrain.is_flat
    levels = env.curriculum.levels.tolist()
    names = env.terrain.terrain_names
    terrains = names[env.curriculum.levels, env.curriculum.columns].tolist()
    place = {name: k for k, name in enumerate(dict.fromkeys(names.ravel().tolist()))}
    across = np.lexsort((levels, [place[name] for name in terrains]))

    def parts(keys: Sequence[tuple[Any, ...]], kinds: Iterable[Any], *names: str) -> list[Part]:
        found = []
        for kind in dict.fromkeys(kinds):
            who = np.array([key == kind for key in keys])
            shared: dict[str, Any] = dict(zip(names, kind, strict=True))
            found.append(Part(**shared, score=score_of(outcome, who, patches=patches)))
        return found

    def by(*names: str) -> tuple[Part, ...]:
        columns = {"terrain": terrains, "level": levels}
        keys = list(zip(*(columns[name] for name in names), strict=True))
        ordered = sorted(keys) if names == ("level",) else [keys[k] for k in across]
        return tuple(parts(keys, ordered, *names)) if patches else ()

    given = [] if commands is None else [(each,) for each in _rounded(commands)]
    return Evaluation(
        robot=run.robot.spec.name,
        checkpoint=run.checkpoint.name if run.checkpoint is not None else "",
        terrain=str(asked.terrain or run.terrain),
        seconds=float(asked.seconds),
        seed=asked.seed,
        whole=score_of(outcome, np.ones(env.num_envs, bool), patches=patches),
        by_command=tuple(parts(given, given, "command")),
        by_terrain=by("terrain"),
        by_level=by("level"),
        by_terrain_and_level=by("terrain", "level"),
    )


def _rounded(commands: FloatArray) -> list[tuple[float, ...]]:
    """Return commands as they are written down: single precision has its tails cut."""
    return [tuple(round(float(each), 4) for each in command) for command in commands]


def write_evaluation(evaluation: Evaluation, path: Path, *, overwrite: bool = False) -> None:
    """Write it as JSON, whole or not at all.

    Raises:
        ExportError: if the file is there and `overwrite` is not set, or cannot be written.
    """
    from terrainkit.atomic_write import atomic_write

    with atomic_write(path, overwrite=overwrite) as target:
        target.write_text(evaluation.as_json())
