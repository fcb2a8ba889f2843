"""The command that measures what a task pays for."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

from msgspec import Meta

from terrainkit.errors import ConfigError
from terrainkit_cli import render
from terrainkit_cli.argument_types import (
    IgnoredRules,
    TaskFile,
    TerrainName,
    parse_settings,
    split_commas,
)
from terrainkit_cli.parse import Command, option, positional
from terrainkit_cli.training_extra import require_training

CELL, LABEL = (100, 28), 220
"""Width and height of a cell of the picture, and width of its labels [pixels]."""


@dataclass(frozen=True, kw_only=True)
class CheckTask(Command):
    """Measure what a task pays for before it is trained.

    Robots with known behaviors run through the step and reward functions of the task: a statue,
    random actions, steps in place, a base that moves exactly as commanded, a fall. The table has
    what each reward term pays for each of them. The rules of the family TSK compare the behaviors;
    `terrainkit rule TSK006` explains one.

    Exit code 0: no errors. 1: errors were found. 2: the task cannot be opened, or an option is
    invalid.
    """

    source: Annotated[str, positional("TASK")] = ""
    """Name of a task, folder of a robot or a run, id of an environment of Gymnasium with MuJoCo, or
    name of a task of mjlab; MODULE:ID imports the module that registers it."""

    host: Literal["terrainkit", "gymnasium", "mjlab"] | None = None
    """Framework of the task; by default, it follows from the name."""

    task: TaskFile | None = None
    """A Python file with a task of your own; it is executed."""

    terrain: TerrainName = ""
    """plane, a map (.npz), or a map config (.toml); by default, plane or the terrain of the run."""

    samples: Annotated[int, Meta(ge=100_000), option("N")] | None = None
    """Also train with this many samples on a plane, and check whether the robot learns to fall;
    100000 take about half a minute. Only for tasks of terrainkit; by default, there is none."""

    format: Literal["text", "json", "sarif", "github"] = "text"
    """Format of the report."""

    picture: Annotated[Path, option("PNG")] | None = None
    """Draw the reward terms of each behavior in this picture; an existing file is replaced."""

    select: Annotated[tuple[str, ...], option("CODES", is_repeated=True)] = ()
    """Run only these rules: comma-separated codes, prefixes of codes, or names."""

    ignore: IgnoredRules = ()
    """Do not run these rules; the reason is printed in the report."""

    def run(self) -> int:
        """Check the task, and print the report."""
        if not self.source and not self.task:
            raise ConfigError("TASK: missing; expected a task, a run, an id, or --task FILE.py")
        from terrainkit.files.atomic_write import atomic_write, check_target
        from terrainkit_robots.lint.report import to_text
        from terrainkit_robots.task_check.check import check_task, host_name, open_host

        if self.picture:
            check_target(self.picture, overwrite=True)
        select = tuple(word for words in self.select for word in split_commas(words))
        settings = replace(parse_settings(self.ignore, (), ()), select=select)
        framework = self.host or host_name(self.source)
        if framework == "terrainkit":
            require_training()
        with render.steps() as steps:
            steps.update(f"opening {self.source or self.task}")
            host = open_host(self.source, framework, self.task, self.terrain)
            report = check_task(host, settings, steps.update, self.samples)
        rewards = report.facts.to_json()["rewards"]
        if self.format == "text":
            render.table(reward_rows(rewards))
            render.result("")
        render.report(to_text([report], self.format))
        if self.picture:
            with atomic_write(self.picture, overwrite=True) as path:
                path.write_bytes(draw_rewards(rewards))
            render.note(f"wrote {self.picture}")
        return int(report.verdict == "fail")


def reward_rows(rewards: Mapping[str, Mapping[str, float]]) -> list[list[str]]:
    """Return the rows of a table: a term each, with a column for each behavior, and the sums."""
    table = {name: {**terms, "sum": sum(terms.values())} for name, terms in rewards.items()}
    terms = next(iter(table.values()))
    rows = [[term, *(f"{column[term]:.3g}" for column in table.values())] for term in terms]
    return [["reward", *table], *rows]


def draw_rewards(rewards: Mapping[str, Mapping[str, float]]) -> bytes:
    """Return a picture of the table as a PNG: green cells pay, red ones cost.

    A color is full from a quarter of what moving as commanded earns, or the statue without it.
    """
    import cv2
    import numpy as np

    header, *rows = reward_rows(rewards)
    reference = "moving" if "moving" in header else "statue"
    full = 0.25 * abs(float(rows[-1][header.index(reference)])) or 1.0
    shape = CELL[1] * (len(rows) + 1), LABEL + CELL[0] * (len(header) - 1)
    image = np.full((*shape, 3), 255, np.uint8)
    for i, row in enumerate([header, *rows]):
        for j, text in enumerate(row):
            x, y = LABEL + CELL[0] * (j - 1) if j else 0, CELL[1] * i
            if i and j:
                faded = 255 - int(180 * min(1.0, abs(float(text)) / full))
                color = (faded, 255, faded) if float(text) > 0 else (faded, faded, 255)
                cv2.rectangle(image, (x, y), (x + CELL[0] - 2, y + CELL[1] - 2), color, cv2.FILLED)
            at = (x + 8, y + CELL[1] - 9)
            cv2.putText(image, text, at, cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0, 0, 0), 1, cv2.LINE_AA)
    return bytes(cv2.imencode(".png", image)[1])
