"""Plant single changes in the code, and print which of them the tests notice.

python benchmarks/mutate.py [--package FOLDER ...] [--changes N] [--seed N] [--hours H] [--retry]

Each change is planted in a copy of the working tree. The tests that mirror the changed file run
first, then the tests of its package, and at last all tests that execute the changed line according
to coverage. The results are kept in .mutate/, and the same command goes on where
it stopped. Changes that alter nothing are listed in mutation/equivalent.toml and not counted.
"""

import argparse
import hashlib
import json
import random
import signal
import sys
import tempfile
import time
import tomllib
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from mutation.changes import Change, find_changes
from mutation.runner import IMPORT_ROOTS, ROOT, Tree

KEPT = ROOT / ".mutate"
"""Folder of the results, the baselines and the coverage."""

EQUIVALENT = Path(__file__).parent / "mutation/equivalent.toml"

STAGES = ("mirrored tests", "package", "suite")
"""Tests that run, in this order, until a change is noticed."""

_EVERY = {
    "rules": Path("tests/terrainkit_robots/lint/test_every_rule.py"),
    "terrains": Path("tests/terrainkit/test_every_terrain.py"),
    "features": Path("tests/terrainkit/test_every_terrain.py"),
    "overlays": Path("tests/terrainkit/test_every_overlay.py"),
}
"""Tests that run for each module of a folder, so that they mirror it as well."""

_SPLIT = {"lint"}
"""Packages that are counted by their subpackages."""


@dataclass(frozen=True, kw_only=True)
class Planted:
    """A planted change and what the tests say.

    `before` and `after` are whole lines. `stage` is the last of `STAGES` that ran.
    """

    path: str
    line: int
    kind: str
    before: str
    after: str
    digest: str
    noticed_by: str = ""
    stage: str = ""

    def __str__(self) -> str:
        return f"{self.path}:{self.line}: {self.before} -> {self.after}"

    @property
    def key(self) -> tuple[str, str, int, str]:
        """Return what identifies the change in a version of a file."""
        return self.path, self.digest, self.line, self.after

    @property
    def edit(self) -> tuple[str, str, str]:
        """Return what identifies the change in the list of those that alter nothing."""
        return self.path, self.before, self.after

    @property
    def package(self) -> str:
        """Return the package in which it is counted."""
        parts = Path(self.path).parts
        first = next(k for k, part in enumerate(parts) if part in IMPORT_ROOTS)
        depth = 3 if parts[first + 1] in _SPLIT else 2
        return "/".join(parts[first : max(min(first + depth, len(parts) - 1), first + 1)])


def main() -> int:
    """Plant changes and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--package", nargs="*", default=["."], help="folders or files")
    parser.add_argument("--changes", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--hours", type=float, default=3.0, help="no change is planted later")
    parser.add_argument("--stages", type=int, default=3, choices=(1, 2, 3))
    parser.add_argument("--retry", action="store_true", help="run the tests on survivors again")
    parser.add_argument("--report", action="store_true", help="only print the table")
    arguments = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    KEPT.mkdir(exist_ok=True)
    results = KEPT / f"{arguments.seed}.jsonl"
    if not arguments.report:
        with tempfile.TemporaryDirectory(prefix="mutate-tree-") as folder:
            _plant_all(Tree(Path(folder) / "tree", KEPT), arguments, results)
    _print_table(list(_read(results).values()))
    return 0


def _plant_all(tree: Tree, arguments: argparse.Namespace, results: Path) -> None:
    end = time.monotonic() + 3600 * arguments.hours
    plan = list(make_plan(tree, arguments.package, arguments.changes, arguments.seed))
    known, equivalent = _read(results), _read_equivalent()
    for k, (planted, source, change) in enumerate(plan):
        if time.monotonic() > end:
            print(f"{len(plan) - k} changes are left; the same command goes on")
            break
        last = known.get(planted.key, planted)
        done = STAGES.index(last.stage) + 1 if last.stage and not arguments.retry else 0
        if last.noticed_by or done >= arguments.stages:
            continue
        begin, found = time.monotonic(), planted
        if planted.edit not in equivalent:
            found = try_change(tree, planted, source, change, STAGES[done : arguments.stages])
        elif planted.key in known:
            continue
        with results.open("a") as file:
            file.write(json.dumps(asdict(found)) + "\n")
        outcome = f"noticed by {found.noticed_by}" if found.noticed_by else "SURVIVED"
        seconds = time.monotonic() - begin
        print(f"{k + 1}/{len(plan)} {seconds:.0f} s {found}: {outcome}", flush=True)


def make_plan(
    tree: Tree, packages: list[str], number: int, seed: int
) -> Iterator[tuple[Planted, bytes, Change]]:
    """Yield changes, so that any number of the first ones is spread evenly over the packages.

    A package gets changes in proportion to its lines that can be changed. Lines are drawn first,
    then a kind of change, so that the many constants do not outweigh the other kinds.
    """
    generator = random.Random(seed)
    lines: dict[str, list[tuple[Path, bytes, list[Change]]]] = defaultdict(list)
    for path in tree.product_files():
        if not any((ROOT / path).is_relative_to((ROOT / each).resolve()) for each in packages):
            continue
        source = (tree.folder / path).read_bytes()
        by_line: dict[int, list[Change]] = defaultdict(list)
        for change in find_changes(source):
            by_line[change.line].append(change)
        package = Planted(path=str(path), line=0, kind="", before="", after="", digest="").package
        lines[package] += [(path, source, changes) for changes in by_line.values()]
    total = sum(map(len, lines.values()))
    places: list[tuple[float, str]] = []
    for package, each in lines.items():
        generator.shuffle(each)
        share = number * len(each) / total
        places += [((k + generator.random()) / share, package) for k in range(len(each))]
    for _, package in sorted(places)[:number]:
        yield _draw(generator, *lines[package].pop())


def _draw(
    generator: random.Random, path: Path, source: bytes, changes: list[Change]
) -> tuple[Planted, bytes, Change]:
    """Return one of the changes of a line."""
    changes = [change for change in changes if change.is_valid(source)]
    kind = generator.choice(sorted({change.kind for change in changes}))
    change = generator.choice([change for change in changes if change.kind == kind])
    before, after = _changed_lines(source, change)
    planted = Planted(
        path=str(path),
        line=change.line,
        kind=kind,
        before=before,
        after=after,
        digest=hashlib.sha1(source).hexdigest()[:12],
    )
    return planted, source, change


def _changed_lines(source: bytes, change: Change) -> tuple[str, str]:
    """Return the lines of a change before and after it, each in one line."""
    start = source.rfind(b"\n", 0, change.start) + 1
    stop = source.find(b"\n", change.end) % (len(source) + 1)
    before = source[start:stop]
    after = source[start : change.start] + change.text.encode() + source[change.end : stop]
    return " ".join(before.decode().split()), " ".join(after.decode().split())


def try_change(
    tree: Tree, planted: Planted, source: bytes, change: Change, stages: tuple[str, ...]
) -> Planted:
    """Run the tests on a change, stage by stage, until one fails."""
    path = Path(planted.path)
    files = _tests(tree, path)
    seen = [file for stage in STAGES[: STAGES.index(stages[0])] for file in files[stage]]
    noticed = stage = ""
    for stage in stages:
        new = [file for file in files[stage] if file not in seen]
        # A statement that no test executes may run in other processes or as a copy, which coverage
        # does not see.
        unseen: list[Path] = []
        if stage == STAGES[1]:
            unseen = [*seen, *new]
        elif stage == STAGES[2]:
            unseen = [file for file in new if path.name in (tree.folder / file).read_text()]
        if _is_covered(tree, seen, path, change.lines):
            unseen = []
        seen += new
        failures = _failures(tree, new, unseen, planted, change.apply(source), change.lines)
        noticed = next(failures, "")
        if noticed:
            break
    return replace(planted, noticed_by=noticed, stage=stage)


def _is_covered(tree: Tree, files: list[Path], path: Path, lines: range) -> bool:
    """Return whether a test executes one of the lines."""
    return any(
        only is None or only for file in files for only in [tree.covering(file, path, lines)]
    )


def _failures(
    tree: Tree,
    files: list[Path],
    unseen: list[Path],
    planted: Planted,
    changed: bytes,
    lines: range,
) -> Iterator[str]:
    """Yield what notices a change.

    If no test of the files executes the statement, all tests of `unseen` run.
    """
    path = Path(planted.path)

    def run(file: Path, only: set[str] | None) -> str:
        baseline = tree.baseline(file)
        with tree.changed(path, changed):
            return tree.run(file, only, limit=baseline).noticed

    is_covered = False
    for file in files:
        only = tree.covering(file, path, lines)
        if only is None or only:
            is_covered = True
            yield from filter(None, [run(file, only)])
    if not is_covered:
        yield from filter(None, (run(file, None) for file in unseen))


def _tests(tree: Tree, path: Path) -> dict[str, list[Path]]:
    """Return the test files of each stage. Those that import the changed module come first.

    They also stand for a missing mirrored file, and else the files of the mirrored folder.
    """
    root = next(name for name in IMPORT_ROOTS if name in path.parts)
    parts = path.parts[path.parts.index(root) : -1]
    folders = [Path("tests", *parts[:k]) for k in range(len(parts), 0, -1)]
    nearest = next(each for each in folders if (tree.folder / each).is_dir())
    names = [nearest / f"test_{name}.py" for name in (path.stem, path.parent.name)]
    mirrored = [name for name in names if (tree.folder / name).exists()][:1]
    mirrored += [file for folder, file in _EVERY.items() if folder in parts]
    module = ".".join((*parts, path.stem))

    def rank(file: Path) -> tuple[bool, bool, Path]:
        return not imports(file), not file.is_relative_to(nearest), file

    def imports(file: Path) -> bool:
        return module in (tree.folder / file).read_text()

    package = sorted(tree.test_files(Path(*nearest.parts[:3])), key=rank)
    suite = sorted(tree.test_files(Path("tests")), key=rank)
    mirrored = mirrored or list(filter(imports, package))
    mirrored = mirrored or [file for file in package if file.parent == nearest]
    return dict(zip(STAGES, (mirrored, package, suite), strict=True))


def _read(results: Path) -> dict[tuple[str, str, int, str], Planted]:
    """Return the last result of each change."""
    lines = results.read_text().splitlines() if results.exists() else []
    return {each.key: each for each in (Planted(**json.loads(line)) for line in lines)}


def _read_equivalent() -> set[tuple[str, str, str]]:
    """Return the changes that alter nothing."""
    listed = tomllib.loads(EQUIVALENT.read_text())["change"]
    return {(each["file"], each["before"], each["after"]) for each in listed}


def _print_table(found: list[Planted]) -> None:
    equivalent = _read_equivalent()
    counts: dict[str, list[int]] = defaultdict(lambda: [0, 0, 0, 0])
    survivors = []
    for each in found:
        outcome = 1 if each.noticed_by else 3 if each.edit in equivalent else 2
        survivors += [each] * (outcome == 2)
        for package in (each.package, "all"):
            counts[package][0] += 1
            counts[package][outcome] += 1
    print(f"{'package':40} planted noticed survived equivalent  noticed")
    for package in sorted(counts, key=lambda name: (name == "all", name)):
        planted, noticed, survived, equal = counts[package]
        share = noticed / (planted - equal) if planted > equal else 1.0
        print(f"{package:40} {planted:7} {noticed:7} {survived:8} {equal:10} {share:8.0%}")
    for each in sorted(survivors, key=lambda each: (each.path, each.line)):
        print(f"{each}  [{each.stage}]")


if __name__ == "__main__":
    sys.exit(main())
