"""Every kind of defect in every healthy robot: how many check-robot finds, and what else it says.

python benchmarks/robot_defects.py [--sites N] [--seed N] [--only CODE] [--robots NAME] [--misses N]

A defect counts as found if there is a finding that the healthy robot does not have, with the right
code, at least as severe as expected, and about the right element: its subject, or named in the
message of a finding on several. Where a defect is put is drawn at random.
The robots are the bundled ones and those of TERRAINKIT_ROBOTS (../shared/robots).
"""

import argparse
import importlib
import os
import pkgutil
import random
import re
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from statistics import median

import defects
from defects.patient import KINDS, Healthy, Kind, NotHereError, Patient
from lxml import etree

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.runner import Finding, lint
from terrainkit_robots.mesh.mesh_cache import Meshes

ROBOTS = Path(
    os.environ.get("TERRAINKIT_ROBOTS", Path(__file__).resolve().parents[2] / "shared" / "robots")
)
URDF = ("a1/urdf/a1.urdf", "go2/urdf/go2.urdf", "h1/urdf/h1.urdf", "g1/g1_29dof.urdf")
MJCF = ("go2_mjcf/go2.xml", "h1/h1.xml", "g1/g1_29dof.xml")

_LONGEST = 60
"""What takes longer counts as a hang [s]."""

RANK = {"info": 0, "warning": 1, "error": 2}


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What was said about one defect."""

    kind: str
    robot: str
    found: bool
    said: tuple[str, ...] = ()
    """Findings that the healthy robot does not have."""

    names: tuple[str, ...] = ()
    """What was broken."""

    extra: int = 0
    """Errors and warnings among them with other codes."""

    crash: str = ""


@dataclass(frozen=True, kw_only=True)
class Clean:
    """What was said about a robot before anything was broken."""

    robot: str
    findings: tuple[str, ...]
    errors: int
    warnings: int
    seconds: float


@dataclass(frozen=True, kw_only=True)
class Result:
    """Everything that the benchmark found out."""

    clean: tuple[Clean, ...]
    outcomes: tuple[Outcome, ...]
    seconds: float


def robots() -> list[Path]:
    """Return the files of the healthy robots, URDF first."""
    own = [path for name in bundled.names() if (path := bundled.find(name))]
    others = [ROBOTS / name for name in (*URDF, *MJCF)]
    there = [path for path in others if path.is_file()]
    return sorted(
        [*own, *(path.with_suffix(".xml") for path in own), *there],
        key=lambda path: (path.suffix, str(path)),
    )


def kinds() -> list[Kind]:
    """Return every kind of defect."""
    for module in pkgutil.iter_modules(defects.__path__):
        importlib.import_module(f"defects.{module.name}")
    return KINDS


def _home(path: Path) -> Path:
    """Return the folder that holds a robot and its meshes."""
    return path.parents[1] if path.parent.name == "urdf" else path.parent


@cache
def _folder() -> Path:
    return Path(tempfile.mkdtemp(prefix=f"defects_{os.getpid()}_", dir=_PARENT[0]))


_PARENT: list[str] = []
"""Where the processes put their copies of the robots."""


def _start(parent: str) -> None:
    _PARENT[:] = [parent]


@cache
def _healthy(path: Path) -> tuple[Healthy, tuple[Finding, ...], Clean, Meshes]:
    home = _home(path)
    folder = _folder() / path.suffix[1:] / home.name
    shutil.copytree(home, folder, copy_function=_link)
    file = folder / path.relative_to(home)
    times: list[float] = []
    while len(times) < 3 and sum(times) < 1:
        meshes = Meshes()
        start = time.perf_counter()
        facts = Facts(load_robot(file), meshes)
        report = lint(facts, simulate=False)
        times.append(time.perf_counter() - start)
    loud = Counter(finding.severity for finding in report.findings)
    clean = Clean(
        robot=path.name,
        findings=tuple(_line(f) for f in report.findings if f.severity != "info"),
        errors=loud["error"],
        warnings=loud["warning"],
        seconds=median(times),
    )
    root = etree.parse(file).getroot()
    healthy = Healthy(label=home.name, file=file, root=root, facts=facts)
    return healthy, report.findings, clean, meshes


def _link(source: str, target: str) -> None:
    try:
        os.link(source, target)
    except OSError:
        shutil.copyfile(source, target)


def _line(finding: Finding) -> str:
    return f"{finding.code} {finding.severity} {finding.subject}: {finding.message}"


def _operate(path: Path, number: int, site: int, seed: int) -> Outcome | None:
    """Break a robot and check it; None if it has no place for the defect."""
    healthy, before, clean, meshes = _healthy(path)
    kind = kinds()[number]
    rng = random.Random(f"{seed} {path.name} {kind.title} {site}")
    patient = Patient(healthy, rng, f"made_{number}_{site}")
    try:
        names = tuple(dict.fromkeys(kind.inject(patient)))
        text = patient.text()
    except NotHereError:
        _tidy(patient)
        return None
    try:
        return _check(patient, kind, clean.robot, names, before, text, meshes)
    finally:
        _tidy(patient)


def _too_long(*_: object) -> None:
    raise TimeoutError(f"longer than {_LONGEST} s")


def _check(
    patient: Patient,
    kind: Kind,
    robot: str,
    names: tuple[str, ...],
    before: Sequence[Finding],
    text: bytes,
    meshes: Meshes,
) -> Outcome:
    file = patient.folder / patient.file_name
    known = {(f.code, f.subject, f.severity) for f in before}
    worded = {(f.code, f.severity, f.message) for f in before}
    signal.signal(signal.SIGALRM, _too_long)
    signal.alarm(_LONGEST)
    try:
        model = load_robot(file, contents={file: text})
        findings = lint(Facts(model, meshes), simulate=False).findings
    except Exception as error:  # a crash or a hang is a miss, and is told
        crash = f"{type(error).__name__}: {error}"
        return Outcome(kind=kind.title, robot=robot, found=False, names=names, crash=crash)
    finally:
        signal.alarm(0)
    new = [f for f in findings if (f.code, f.subject, f.severity) not in known]
    return Outcome(
        kind=kind.title,
        robot=robot,
        found=any(_meets(f, kind, names) for f in new)
        or any(
            _meets(f, kind, ()) and _mentions(f, names)
            for f in findings
            if (f.code, f.severity, f.message) not in worded
        ),
        said=tuple(_line(f) for f in new),
        names=names,
        extra=sum(f.severity != "info" and f.code not in kind.codes for f in new),
    )


def _meets(finding: Finding, kind: Kind, names: Iterable[str]) -> bool:
    if finding.code not in kind.codes or RANK[finding.severity] < RANK[kind.severity]:
        return False
    wanted = set(names)
    parts = {finding.subject, *re.split(r" and |, ", finding.subject)}
    return not wanted or bool(parts & wanted)


def _mentions(finding: Finding, names: Iterable[str]) -> bool:
    words = set(re.findall(r"[^\s,;:()]+", finding.message))
    return not words.isdisjoint(names)


def _tidy(patient: Patient) -> None:
    for path in patient.written:
        path.unlink(missing_ok=True)


def _batch(
    path: Path, numbers: Sequence[int], sites: int, seed: int
) -> tuple[Clean, list[Outcome]]:
    start = time.perf_counter()
    outcomes = [
        outcome
        for number in numbers
        for site in range(sites)
        if (outcome := _operate(path, number, site, seed)) is not None
    ]
    clean = _healthy(path)[2]
    print(f"{path.name}: {time.perf_counter() - start:.0f} s", file=sys.stderr, flush=True)
    return clean, outcomes


def _weight(path: Path) -> int:
    return sum(file.stat().st_size for file in _home(path).rglob("*"))


def _sites(path: Path, sites: int) -> int:
    """Return at how many places a robot is broken: half as many if its meshes are large."""
    return (sites + 1) // 2 if _weight(path) > _HEAVY else sites


_HEAVY = 14_000_000
"""Meshes of so many bytes make a check slow."""


def measure(sites: int = 2, seed: int = 0, only: str = "", named: str = "") -> Result:
    """Break every robot in every way, at `sites` places each, or half of that."""
    start = time.perf_counter()
    tasks = []
    for path in [path for path in robots() if named in path.name]:
        format_ = "mjcf" if path.suffix == ".xml" else "urdf"
        numbers = [
            number
            for number, kind in enumerate(kinds())
            if kind.formats == format_ and any(code.startswith(only) for code in kind.codes)
        ]
        tasks.append((path, numbers))
    tasks.sort(key=lambda task: -_weight(task[0]))  # the longest first, so that none ends last
    clean: dict[Path, Clean] = {}
    outcomes: list[Outcome] = []
    with (
        tempfile.TemporaryDirectory() as parent,
        ProcessPoolExecutor(
            len(os.sched_getaffinity(0)), initializer=_start, initargs=(parent,)
        ) as pool,
    ):
        futures = [
            (path, pool.submit(_batch, path, part, _sites(path, sites), seed))
            for path, part in tasks
        ]
        for path, future in futures:
            clean[path], part = future.result()
            outcomes += part
    return Result(
        clean=tuple(clean.values()),
        outcomes=tuple(outcomes),
        seconds=time.perf_counter() - start,
    )


def _values(result: Result) -> Iterator[tuple[str, float]]:
    by_kind = _by_kind(result)
    found = sum(outcome.found for outcome in result.outcomes)
    shares = [sum(o.found for o in group) / len(group) for group in by_kind.values()]
    yield "kinds (at least 60)", len(by_kind)
    yield "robots", len(result.clean)
    yield "defects", len(result.outcomes)
    yield "recall (at least 0.97)", found / len(result.outcomes)
    yield "recall_mean_of_kinds (at least 0.97)", sum(shares) / len(shares)
    yield "kinds_found_always", sum(share == 1 for share in shares)
    yield "crashes (at most 0)", sum(bool(outcome.crash) for outcome in result.outcomes)
    yield "false_alarms (at most 0)", sum(clean.errors for clean in result.clean)
    yield "warnings_on_clean", sum(clean.warnings for clean in result.clean)
    yield "extra_findings_per_defect", sum(o.extra for o in result.outcomes) / len(result.outcomes)
    yield "seconds_per_check", median(clean.seconds for clean in result.clean)
    yield "seconds_of_slowest_check", max(clean.seconds for clean in result.clean)


def _by_kind(result: Result) -> dict[str, list[Outcome]]:
    groups: dict[str, list[Outcome]] = defaultdict(list)
    for outcome in result.outcomes:
        groups[outcome.kind].append(outcome)
    return groups


def run() -> Iterator[tuple[str, float]]:
    """Yield the figures; for benchmarks/run.py."""
    yield from _values(measure())


def _table(result: Result) -> Iterator[str]:
    codes = {kind.title: kind for kind in kinds()}
    rows = []
    for title, group in _by_kind(result).items():
        share = sum(o.found for o in group) / len(group)
        extra = sum(o.extra for o in group) / len(group)
        rows.append((share, title, len(group), extra))
    yield f"{'recall':>7} {'of':>4} {'extra':>6}  {'expected':22} kind"
    for share, title, count, extra in sorted(rows):
        kind = codes[title]
        expected = f"{'/'.join(kind.codes)} {kind.severity}"
        yield f"{share:7.2f} {count:4d} {extra:6.1f}  {expected:22} {title}"
    for title in sorted(codes.keys() - _by_kind(result).keys()):
        yield f"{'-':>7} {0:4d} {'-':>6}  {'/'.join(codes[title].codes):22} {title}"


def _misses(result: Result, shown: int) -> Iterator[str]:
    for title, group in sorted(_by_kind(result).items()):
        for outcome in [o for o in group if not o.found][:shown]:
            yield f"missed: {title}, in {outcome.robot}: {', '.join(outcome.names)}"
            yield from (f"    {line}" for line in (outcome.crash, *outcome.said[:6]) if line)


def main() -> None:
    """Print the table and the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sites", type=int, default=2, help="places for each defect and robot")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="codes that start like this")
    parser.add_argument("--robots", default="", help="files whose names have this in them")
    parser.add_argument("--misses", type=int, default=2, help="how many to show of each kind")
    options = parser.parse_args()
    result = measure(options.sites, options.seed, options.only, options.robots)
    print(*_table(result), sep="\n")
    print(*_misses(result, options.misses), sep="\n")
    for clean in result.clean:
        print(f"clean: {clean.robot}: {clean.seconds:.2f} s", *clean.findings, sep="\n    ")
    print(f"whole run: {result.seconds:.0f} s")
    for name, value in _values(result):
        print(f"defect_{name} {value:.3g}")


if __name__ == "__main__":
    main()
