"""Recall of check-robot: add every kind of defect to every robot, and count those that are found.

python benchmarks/robot_defects.py [--sites N] [--seed N] [--only CODE] [--robots NAME] [--misses N]

A defect is found if check-robot reports a finding that the original robot does not have, with an
expected code, at least the expected severity, and the expected element as its subject or in its
message. The element that gets the defect is random.
The robots are the bundled ones and those in TERRAINKIT_ROBOTS (../shared/robots).
"""

import argparse
import copy
import os
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

from lxml import etree
from mutants.defect import Defect, load_defects
from mutants.mutant import Mutant, NotApplicableError
from mutants.robot import SourceRobot
from mutants.robot_files import ROBOT_FILES, robot_folder

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.check import lint_selected
from terrainkit_robots.lint.rule import Finding
from terrainkit_robots.lint.settings import Settings
from terrainkit_robots.mesh.mesh_cache import Meshes

DEFECTS = Path(__file__).parent / "defects"

_MAX_SECONDS = 60
"""A check that takes longer counts as a crash [s]."""

_MAX_MESH_BYTES = 14_000_000
"""Robots with more mesh data get half as many mutants, since each check is slow."""

_LEVELS = {"note": 0, "warning": 1, "error": 2}


@dataclass(frozen=True, kw_only=True)
class MutantResult:
    """The findings on one mutant."""

    title: str
    robot: str
    is_found: bool
    findings: tuple[str, ...] = ()
    """Findings that the original robot does not have."""

    names: tuple[str, ...] = ()
    """Names of the elements with the defect."""

    extra: int = 0
    """Number of new errors and warnings with other codes."""

    error: str = ""
    """The exception if the check failed."""


@dataclass(frozen=True, kw_only=True)
class SourceResult:
    """The findings on a robot without defects."""

    robot: str
    findings: tuple[str, ...]
    errors: int
    warnings: int
    seconds: float


@dataclass(frozen=True, kw_only=True)
class Result:
    """The result of the whole benchmark."""

    sources: tuple[SourceResult, ...]
    mutants: tuple[MutantResult, ...]
    seconds: float


def robots() -> list[Path]:
    """Return the files of the original robots, URDF first."""
    existing = filter(Path.is_file, ROBOT_FILES.values())
    return sorted(existing, key=lambda path: (path.suffix, str(path)))


@cache
def defects() -> list[Defect]:
    """Return all kinds of defects."""
    return [defect for path in sorted(DEFECTS.glob("*.toml")) for defect in load_defects(path)]


_PARENT: list[str] = []
"""Folder for the copies of the robots; set in each process."""


def _init_process(parent: str) -> None:
    _PARENT[:] = [parent]


@cache
def _process_folder() -> Path:
    return Path(tempfile.mkdtemp(prefix=f"defects_{os.getpid()}_", dir=_PARENT[0]))


@cache
def _load_source(path: Path) -> tuple[SourceRobot, tuple[Finding, ...], SourceResult, Meshes]:
    """Copy a robot to the folder of this process, and check it."""
    source_folder = robot_folder(path)
    folder = _process_folder() / path.suffix[1:] / source_folder.name
    shutil.copytree(source_folder, folder, copy_function=_link)
    file = folder / path.relative_to(source_folder)
    start, meshes = time.perf_counter(), Meshes()
    facts = Facts(load_robot(file), meshes)
    report = lint_selected(facts, Settings(simulate=False))
    seconds = time.perf_counter() - start
    counts = Counter(finding.severity for finding in report.findings)
    result = SourceResult(
        robot=path.name,
        findings=tuple(_format(f) for f in report.findings if f.severity != "note"),
        errors=counts["error"],
        warnings=counts["warning"],
        seconds=seconds,
    )
    root = etree.parse(file).getroot()
    source = SourceRobot(label=source_folder.name, file=file, root=root, facts=facts)
    return source, report.findings, result, meshes


def _link(source: str, target: str) -> None:
    try:
        os.link(source, target)
    except OSError:
        shutil.copyfile(source, target)


def _format(finding: Finding) -> str:
    return f"{finding.code} {finding.severity} {finding.subject}: {finding.message}"


def _test_mutant(path: Path, index: int, site: int, seed: int) -> MutantResult | None:
    """Add a defect to a robot and check it; None if the defect is not applicable."""
    source, findings, result, meshes = _load_source(path)
    defect = defects()[index]
    mutant = Mutant(
        copy.deepcopy(source.root),
        random.Random(f"{seed} {path.name} {defect.title} {site}"),
        source.file,
        prefix=f"mutant_{index}_{site}",
        functions=source.functions(),
    )
    try:
        names = defect.apply(mutant)
        for name, content in mutant.files.items():
            file = mutant.folder / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(content)
        return _check(mutant, defect, result.robot, names, findings, meshes)
    except NotApplicableError:
        return None
    finally:
        for name in mutant.files:
            (mutant.folder / name).unlink(missing_ok=True)


def _raise_timeout(*_: object) -> None:
    raise TimeoutError(f"longer than {_MAX_SECONDS} s")


def _check(
    mutant: Mutant,
    defect: Defect,
    robot: str,
    names: tuple[str, ...],
    source_findings: Sequence[Finding],
    meshes: Meshes,
) -> MutantResult:
    file = mutant.folder / mutant.file_name
    text = mutant.rewrite(etree.tostring(mutant.root.getroottree(), encoding="utf-8"))
    known = {(f.code, f.subject, f.severity) for f in source_findings}
    known_messages = {(f.code, f.severity, f.message) for f in source_findings}
    signal.signal(signal.SIGALRM, _raise_timeout)
    signal.alarm(_MAX_SECONDS)
    try:
        model = load_robot(file, contents={file: text})
        findings = lint_selected(Facts(model, meshes), Settings(simulate=False)).findings
    except Exception as exception:  # a crash or a timeout counts as a miss
        error = f"{type(exception).__name__}: {exception}"
        return MutantResult(
            title=defect.title, robot=robot, is_found=False, names=names, error=error
        )
    finally:
        signal.alarm(0)
    new = [f for f in findings if (f.code, f.subject, f.severity) not in known]
    changed = [f for f in findings if (f.code, f.severity, f.message) not in known_messages]
    return MutantResult(
        title=defect.title,
        robot=robot,
        is_found=any(_is_expected(f, defect) and _has_subject(f, names) for f in new)
        or any(_is_expected(f, defect) and _has_name(f, names) for f in changed),
        findings=tuple(_format(f) for f in new),
        names=names,
        extra=sum(f.severity != "note" and f.code not in defect.codes for f in new),
    )


def _is_expected(finding: Finding, defect: Defect) -> bool:
    severe = _LEVELS[finding.severity] >= _LEVELS[defect.severity]
    return finding.code in defect.codes and severe


def _has_subject(finding: Finding, names: Sequence[str]) -> bool:
    subjects = {finding.subject, *re.split(r" and |, ", finding.subject)}
    return not names or not subjects.isdisjoint(names)


def _has_name(finding: Finding, names: Iterable[str]) -> bool:
    return not set(re.findall(r"[^\s,;:()]+", finding.message)).isdisjoint(names)


def _test_robot(
    path: Path, indices: Sequence[int], sites: int, seed: int
) -> tuple[SourceResult, list[MutantResult]]:
    start = time.perf_counter()
    results = [
        result
        for index in indices
        for site in range(sites)
        if (result := _test_mutant(path, index, site, seed)) is not None
    ]
    source = _load_source(path)[2]
    print(f"{path.name}: {time.perf_counter() - start:.0f} s", file=sys.stderr, flush=True)
    return source, results


def _is_selected(defect: Defect, only: str) -> bool:
    return any(code.startswith(only) for code in defect.codes)


def measure(sites: int = 2, seed: int = 0, only: str = "", robot: str = "") -> Result:
    """Test every defect on every robot.

    Args:
        sites: Number of mutants for each defect and robot.
        seed: Seed of the random elements.
        only: Test only defects with a code that starts like this.
        robot: Test only robots whose file name contains this.
    """
    start = time.perf_counter()
    tasks = []
    for path in [path for path in robots() if robot in path.name]:
        format_ = "mjcf" if path.suffix == ".xml" else "urdf"
        indices = [
            index
            for index, defect in enumerate(defects())
            if defect.format == format_ and _is_selected(defect, only)
        ]
        size = sum(file.stat().st_size for file in robot_folder(path).rglob("*"))
        tasks.append((size, path, indices, (sites + 1) // 2 if size > _MAX_MESH_BYTES else sites))
    if not any(indices for _, _, indices, _ in tasks):
        sys.exit(f"no defect for --only {only!r} and --robots {robot!r}; see {DEFECTS}")
    tasks.sort(key=lambda task: -task[0])  # start the longest first
    sources: dict[Path, SourceResult] = {}
    mutants: list[MutantResult] = []
    with (
        tempfile.TemporaryDirectory() as parent,
        ProcessPoolExecutor(
            len(os.sched_getaffinity(0)), initializer=_init_process, initargs=(parent,)
        ) as pool,
    ):
        futures = [
            (path, pool.submit(_test_robot, path, indices, count, seed))
            for _, path, indices, count in tasks
        ]
        for path, future in futures:
            sources[path], results = future.result()
            mutants += results
    return Result(
        sources=tuple(sources.values()),
        mutants=tuple(mutants),
        seconds=time.perf_counter() - start,
    )


def _values(result: Result) -> Iterator[tuple[str, float]]:
    by_title = _by_title(result)
    mutants, sources = result.mutants, result.sources
    recalls = [_recall(group) for group in by_title.values()]
    yield "kinds (at least 60)", len(by_title)
    yield "robots", len(sources)
    yield "defects", len(mutants)
    yield "recall (at least 0.97)", _recall(mutants)
    yield "recall_mean_of_kinds (at least 0.97)", sum(recalls) / len(recalls)
    yield "kinds_found_always", sum(recall == 1 for recall in recalls)
    yield "crashes (at most 0)", sum(bool(mutant.error) for mutant in mutants)
    yield "false_alarms (at most 0)", sum(source.errors for source in sources)
    yield "warnings_on_clean", sum(source.warnings for source in sources)
    yield "extra_findings_per_defect", sum(mutant.extra for mutant in mutants) / len(mutants)
    yield "seconds_per_check", median(source.seconds for source in sources)
    yield "seconds_of_slowest_check", max(source.seconds for source in sources)


def _recall(mutants: Sequence[MutantResult]) -> float:
    return sum(mutant.is_found for mutant in mutants) / len(mutants)


def _by_title(result: Result) -> dict[str, list[MutantResult]]:
    groups: dict[str, list[MutantResult]] = defaultdict(list)
    for mutant in result.mutants:
        groups[mutant.title].append(mutant)
    return groups


def run() -> Iterator[tuple[str, float]]:
    """Yield the values for benchmarks/run.py."""
    yield from _values(measure())


def _table(result: Result, only: str) -> Iterator[str]:
    by_title = _by_title(result)
    selected = [defect for defect in defects() if _is_selected(defect, only)]
    expected = {m.title: f"{'/'.join(m.codes)} {m.severity}" for m in selected}
    rows = [
        (_recall(group), title, len(group), sum(mutant.extra for mutant in group) / len(group))
        for title, group in by_title.items()
    ]
    yield f"{'recall':>7} {'of':>4} {'extra':>6}  {'expected':22} defect"
    for recall, title, count, extra in sorted(rows):
        yield f"{recall:7.2f} {count:4d} {extra:6.1f}  {expected[title]:22} {title}"
    for title in sorted(expected.keys() - by_title.keys()):
        yield f"{'-':>7} {0:4d} {'-':>6}  {expected[title]:22} {title}"


def _missed(result: Result, count: int) -> Iterator[str]:
    for title, group in sorted(_by_title(result).items()):
        for mutant in [mutant for mutant in group if not mutant.is_found][:count]:
            yield f"missed: {title}, in {mutant.robot}: {', '.join(mutant.names)}"
            yield from (f"    {line}" for line in (mutant.error, *mutant.findings[:6]) if line)


def main() -> None:
    """Print the table and the values."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sites", type=int, default=2, help="mutants for each defect and robot")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="only codes that start like this")
    parser.add_argument("--robots", default="", help="only files whose names contain this")
    parser.add_argument("--misses", type=int, default=2, help="misses to print for each defect")
    options = parser.parse_args()
    result = measure(options.sites, options.seed, options.only, options.robots)
    print(*_table(result, options.only), sep="\n")
    print(*_missed(result, options.misses), sep="\n")
    for source in result.sources:
        print(f"original: {source.robot}: {source.seconds:.2f} s", *source.findings, sep="\n    ")
    print(f"whole run: {result.seconds:.0f} s")
    for name, value in _values(result):
        print(f"defect_{name} {value:.3g}")


if __name__ == "__main__":
    main()
