"""Measure published robots, and write what is normal into norms.toml of terrainkit_robots.

python docs/robot_norms.py FOLDER... --results FOLDER    folders with unpacked wheels and checkouts
    --half A or B    of one half of the robots only, to test the norms on the other half

Each robot counts once: of the files of a family, such as go2, the one with the fewest errors. Each
result is kept in --results, so that a run can be continued. A value counts if no rule has an error
or a warning about its link or joint, and no unit of the robot is wrong.
"""

import argparse
import hashlib
import json
import os
import re
import signal
import sys
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from field_robots import robots as listed_robots
from published_gains import read_published, values_of

from terrainkit.errors import TerrainkitError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.norms import LEVELS, NORMS, QUANTITIES, ROLES, measure
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.description.robot_folder import robot_files
from terrainkit_robots.lint.check import lint_selected
from terrainkit_robots.lint.rule import rules
from terrainkit_robots.lint.settings import Settings

SECONDS = 60
"""Time limit of a robot [s]."""

MIN_ROBOTS = 30
"""Robots that a norm needs, at least."""

GENERAL = re.compile(
    r"(urdf|robots?|descriptions?|mjcf|xml|scene|sim|models?|main|full|with|test|final|base|body"
    r"|gripper|left|right|fixed|floating|mjx|mujoco|gazebo|ros2?|isaac|gym|assets?|resources|data"
    r"|quadruped|humanoid|biped|hexapod|unitree|src|config|package|xacro|arm|v\d+|\d+dof)$"
)
"""Words that do not name a robot."""


def family(path: Path, name: str) -> str:
    """Return the word that names a robot, from the name in its file or from its path."""
    for text in (name, path.stem, *reversed(path.parts[:-1])):
        split = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", text).lower()
        words: list[str] = re.findall(r"[a-z]+\d*", split)
        for word in words:
            if len(word) > 1 and not GENERAL.match(word):
                return word
    return path.stem


def measure_robot(file: Path) -> Mapping[str, Any]:
    """Return the quantities of a robot, and the findings on it."""
    robot = Facts(load_robot(file))
    report = lint_selected(robot, Settings(simulate=False))
    return {
        "legs": len(robot.legs),
        "joints": len(robot.joints),
        "mass": robot.total_mass,
        "samples": [(s.quantity, s.role, s.value, s.element.name) for s in measure(robot)],
        "findings": [(f.code, f.severity, f.subject, f.message) for f in report.findings],
    }


def measure_kept(file: Path, results: Path) -> Mapping[str, Any]:
    """Return the kept result of a robot, else measure it in a process of its own and keep it."""
    kept = results / f"{hashlib.sha256(str(file).encode()).hexdigest()[:16]}.json"
    if not kept.exists():
        if (process := os.fork()) == 0:
            signal.alarm(SECONDS)
            try:
                kept.write_text(json.dumps(measure_robot(file)))
            except (TerrainkitError, OSError, ValueError, ArithmeticError, LookupError) as error:
                sys.stderr.write(f"{file}: {error}\n")
            os._exit(0)
        os.waitpid(process, 0)
    if not kept.exists() or not kept.stat().st_size:
        kept.write_text("{}")  # too slow, or no robot
    found: Mapping[str, Any] = json.loads(kept.read_text())
    return found


def robots(folders: Sequence[Path], results: Path) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield one robot of each family, without copies under other names.

    It is the URDF or the MJCF file with the fewest errors, of those with the most joints. The other
    one adds quantities that this one lacks, such as gains.
    """
    files = defaultdict(list)
    for folder in folders:
        for file in robot_files(folder):
            text = file.read_text(errors="ignore")
            joints = len(re.findall("<joint|<xacro:include", text))
            match = re.search(r'<(?:robot|mujoco)\b[^>]*\b(?:name|model)="([^"$]*)"', text)
            if joints > 1 and match is not None:
                place = file.relative_to(folder)
                files[family(place, match[1])].append((-joints, file))
    seen = set()
    for name, found in sorted(files.items()):
        by_kind = {
            file.suffix in (".xml", ".mjcf"): file for _, file in sorted(found, reverse=True)
        }
        measured = [measure_kept(file, results) for file in by_kind.values()]
        usable = [robot for robot in measured if robot.get("joints", 0) > 1 and robot["samples"]]
        usable.sort(key=lambda robot: sum(f[1] == "error" for f in robot["findings"]))
        if usable and (copy := (usable[0]["joints"], round(usable[0]["mass"], 3))) not in seen:
            seen.add(copy)
            known = {sample[0] for sample in usable[0]["samples"]}
            more = [s for robot in usable[1:] for s in robot["samples"] if s[0] not in known]
            findings = [finding for robot in usable for finding in robot["findings"]]
            samples = [*usable[0]["samples"], *more]
            yield name, {**usable[0], "samples": samples, "findings": findings}


def published(folders: Sequence[Path]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield the gains that field_robots.toml names a place of, one robot for each place."""
    done = set()
    for robot in listed_robots()[0]:
        places = [folder / robot.published for folder in folders]
        files = [folder / robot.under / robot.file for folder in folders]
        file = next((file for file in files if file.exists()), None)
        place = next((p for p in places if Path(str(p).partition(":")[0]).exists()), None)
        if not robot.published or file is None or place is None or robot.published in done:
            continue
        done.add(robot.published)
        model, tables = load_robot(file), read_published(place)
        names = [joint.name for joint in model.joints]
        damping = values_of(tables["damping"], names)
        stiffness = values_of(tables["stiffness"], names)
        gains = {name: (value, damping.get(name, 0.0)) for name, value in stiffness.items()}
        samples = [
            (s.quantity, s.role, s.value, s.element.name)
            for s in measure(Facts(model), gains)
            if s.quantity in ("stiffness", "damping")
        ]
        yield family(Path(robot.file), model.name), {"samples": samples, "findings": []}


def half(name: str) -> str:
    """Return the half that a family belongs to, which was fixed before the first result."""
    return "AB"[int(hashlib.sha256(name.encode()).hexdigest()[:8], 16) % 2]


def clean_values(robot: Mapping[str, Any]) -> Iterator[tuple[tuple[str, str], float]]:
    """Yield quantity, role and value of what no rule finds an error or a warning about."""
    wrong = [f for f in robot["findings"] if f[1] != "note" and not f[0].startswith("NRM")]
    texts = "\n".join(f"{subject} {message}" for _, _, subject, message in wrong)
    if any(code.startswith("UNI") for code, *_ in wrong):
        return
    for quantity, role, value, name in robot["samples"]:
        if name not in texts:
            yield (quantity, role), value


def norms_text(found: Sequence[Mapping[str, Any]]) -> str:
    """Return the text of norms.toml."""
    values: dict[tuple[str, str], dict[int, list[float]]] = defaultdict(lambda: defaultdict(list))
    for number, robot in enumerate(found):
        for key, value in clean_values(robot):
            values[key][number].append(value)
    levels = np.array(LEVELS)
    lines = [
        f"# Written by docs/robot_norms.py from {len(found)} robots. Number of robots with a role,",
        f"# and their values at {', '.join(f'{level:g}' for level in LEVELS)}.",
    ]
    for quantity in QUANTITIES:
        lines += ["", f'["{quantity}"]']
        for role in ROLES:
            by_robot = list(values[quantity, role].values())
            if len(by_robot) >= MIN_ROBOTS:
                ends = [
                    np.quantile([min(row) for row in by_robot], levels[levels < 0.5]),
                    [np.median([np.median(row) for row in by_robot])],
                    np.quantile([max(row) for row in by_robot], levels[levels > 0.5]),
                ]
                row = ", ".join(f"{value:.4g}" for value in np.concatenate(ends))
                lines.append(f"{role} = [{len(by_robot)}, {row}]")
    return "\n".join(lines) + "\n"


def main() -> int:
    """Write norms.toml."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER")
    parser.add_argument("--results", type=Path, metavar="FOLDER", required=True)
    parser.add_argument("--half", choices=("A", "B"))
    parser.add_argument("-o", "--output", type=Path, default=NORMS, metavar="FILE")
    options = parser.parse_args()
    options.results.mkdir(parents=True, exist_ok=True)
    rules()  # loaded once, before the processes of the robots start
    found = [*robots(options.folders, options.results), *published(options.folders)]
    chosen = [robot for name, robot in found if options.half in (None, half(name))]
    options.output.write_text(norms_text(chosen))
    sys.stdout.write(f"{len(chosen)} robots and published gains\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
