"""What `check-robot --train-smoke` does: see whether robots can be trained."""

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING

from terrainkit.errors import ConfigError, TerrainkitError, listing
from terrainkit_cli import render
from terrainkit_cli.robot_options import packages, reasons, xacro_arguments
from terrainkit_cli.training_extra import require_training

if TYPE_CHECKING:
    from terrainkit_cli.robot_commands import CheckRobot
    from terrainkit_robots.lint.settings import Settings
    from terrainkit_robots.policy.smoke_test import Smoke

SCHEMA_VERSION = 1
"""Raised when a key changes its meaning or goes; new keys may come without."""


def check_training(command: "CheckRobot") -> int:
    """See whether each robot can be trained, say so, and return the exit code.

    Raises:
        ConfigError: if an option makes no sense here, or a package is missing.
    """
    _refuse_others(command)
    _refuse_unused(command)
    require_training()
    settings = _settings(command)
    if command.output:
        from terrainkit.atomic_write import check_target

        check_target(Path(command.output), overwrite=True)  # before the wait
    found: list[tuple[str, Smoke]] = []
    with render.steps() as steps:
        for name in command.files:
            steps.say(f"training {name} for a moment")
            smoke = _tried(name, command, settings)
            if smoke is not None:
                found.append((name, smoke))
    text = _as_json(found) if command.format == "json" else _as_text(found)
    if command.output:
        from terrainkit.atomic_write import atomic_write

        with atomic_write(Path(command.output), overwrite=True) as path:
            path.write_text(text, encoding="utf-8")
        render.result(f"wrote {command.output}: {', '.join(_verdict(smoke) for _, smoke in found)}")
    else:
        render.report(text)
    if len(found) < len(command.files):
        return 2
    return int(not all(smoke.passed for _, smoke in found))


def _refuse_others(command: "CheckRobot") -> None:
    """Refuse options that ask for something else."""
    if command.format not in ("text", "json"):
        raise ConfigError(f"--train-smoke reports as text or json; not as {command.format}")
    others = "select", "against", "no-simulation", "strict", "fix", "unsafe-fixes", "diff"
    given = _given(command, *others)
    if given:
        raise ConfigError(f"--train-smoke asks no rules, so --{given[0]} makes no sense with it")
    if command.spec and len(command.files) > 1:
        raise ConfigError(f"--spec is of one robot, and there are {len(command.files)}")


def _refuse_unused(command: "CheckRobot") -> None:
    """Refuse options of use for a robot's file alone where there is none."""
    given = _given(command, "package", "xacro-arg", "ignore", "spec")
    # not Path.is_file, which raises where a name is too long
    if given and not any(map(os.path.isfile, command.files)):
        raise ConfigError(
            f"--{given[0]} is for a robot's file, which --train-smoke onboards first; "
            f"no file is called: {listing(command.files)}"
        )


def _given(command: "CheckRobot", *options: str) -> list[str]:
    """Return those of the options that are given."""
    return [option for option in options if getattr(command, option.replace("-", "_"))]


def _settings(command: "CheckRobot") -> "Settings":
    from terrainkit_robots.lint.settings import Settings

    return Settings(
        ignore=reasons(command.ignore),
        packages=packages(command.package),
        xacro_arguments=xacro_arguments(command.xacro_arg),
    )


def _tried(name: str, command: "CheckRobot", settings: "Settings") -> "Smoke | None":
    """Return what is found of a robot; None, and one line of error, if that failed."""
    from terrainkit_robots.policy.smoke_test import smoke_of

    spec = Path(command.spec) if command.spec else None
    try:
        return smoke_of(name, settings=settings, spec=spec)
    except TerrainkitError as error:
        render.error(str(error))
    except OSError as error:
        render.error(f"{name}: {error.strerror or error}")
    return None


def _verdict(smoke: "Smoke") -> str:
    failed = sum(not check.passed for check in smoke.checks)
    if not failed:
        return f"{smoke.robot} can be trained"
    return f"{smoke.robot}: {failed} of {len(smoke.checks)} checks failed"


def _as_text(found: "list[tuple[str, Smoke]]") -> str:
    """Return a table for each robot, with what was wanted where it is not so."""
    blocks = []
    for name, smoke in found:
        width = max(len(check.name) for check in smoke.checks)
        lines = [f"robot     {smoke.robot} ({name})", ""]
        for check in smoke.checks:
            lines.append(f"{_word(check.passed)}  {check.name.ljust(width)}  {check.measured}")
            if not check.passed:
                lines.append(f"{'':4}  {'':{width}}  wanted: {check.wanted}")
        blocks.append("\n".join([*lines, "", f"{_verdict(smoke)}\n"]))
    return "\n".join(blocks)


def _word(passed: bool) -> str:
    return "ok  " if passed else "FAIL"


def _as_json(found: "list[tuple[str, Smoke]]") -> str:
    """Return one document, indented; several are JSON lines."""
    from terrainkit import __version__
    from terrainkit_robots.policy.smoke_test import record

    head = {
        "schema_version": SCHEMA_VERSION,
        "tool": {"name": "terrainkit", "version": __version__},
    }
    documents = [{**head, "file": name, **record(smoke)} for name, smoke in found]
    indent = 2 if len(documents) == 1 else None
    return "".join(f"{json.dumps(document, indent=indent)}\n" for document in documents)
