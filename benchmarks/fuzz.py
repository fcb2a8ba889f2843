"""Read damaged and hostile files with the commands of terrainkit, and print what they must not do.

python benchmarks/fuzz.py [--minutes N | --inputs N] [--seed N] [--only SURFACE ...]
python benchmarks/fuzz.py --keep FOLDER ...

Each input is read in a forked process with limits of time and memory. A command has to succeed, or
print one error, and leave neither files nor processes. An audit hook reports code that is executed
and files that are written elsewhere. The first input of each kind of failure is minimized and kept
in .fuzz/; --keep copies what is needed of such a folder to the corpus, which is read first.
"""

import argparse
import importlib
import json
import os
import re
import shutil
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

from fuzzing.forked import KINDS, Failure, run_forked
from fuzzing.surfaces import (
    CORPUS,
    FILE,
    Surface,
    load_surfaces,
    num_listed,
    prepare,
    prepare_seed,
)

KEPT = Path(__file__).parents[1] / ".fuzz"
"""Folder of the inputs that failed."""

_MINIMIZE_SECONDS = 20
"""Time for minimizing an input [s]."""

_MAX_MINIMIZED = 1 << 24
"""Size from which an input is not minimized [bytes]."""


class Fuzzer:
    """Reads the inputs of a surface."""

    def __init__(self, surface: Surface, seed: int, folder: Path) -> None:
        """Import what its commands import, and write its valid files."""
        self.surface, self.seed, self.folder = surface, seed, folder
        self.failures: dict[int, Failure] = {}
        self.num_tried = 0
        for name in ("terrainkit_cli.main", *surface.imports):
            importlib.import_module(name)
        self.seeds = FILE.with_name("seeds") / surface.name
        for k, line in enumerate(surface.seeds):
            failure = run_forked(folder / f"seed_{k}", partial(prepare_seed, self.seeds, line))
            printed = (folder / f"seed_{k}/stderr").read_text()
            if (failure and failure.kind != "files") or "terrainkit: error" in printed:
                raise RuntimeError(f"{surface.name}: {line}: {failure}: {printed}")
            self.seeds = folder / f"seed_{k}" / "work"

    def run(self, seconds: float, inputs: int) -> None:
        """Read a number of inputs, or for some time, but all that are listed."""
        inputs = inputs or num_listed(self.surface)
        end, number = time.monotonic() + seconds, os.cpu_count() or 1
        with ProcessPoolExecutor(number, get_context("fork")) as pool:
            while (missing := inputs - self.num_tried) > 0 or time.monotonic() < end:
                count = min(missing, 8 * number) if missing > 0 else 8 * number
                indices = range(self.num_tried, self.num_tried + count)
                failures = zip(indices, pool.map(self.read_input, indices), strict=True)
                self.failures |= {index: failure for index, failure in failures if failure}
                self.num_tried = indices.stop

    def read_input(self, index: int, data: bytes | None = None) -> Failure | None:
        """Read an input, whose damaged file may have other content, in a forked process."""
        make = partial(prepare, self.surface, self.seeds, self.seed, index, data)
        folder = self.folder / f"{index}_{time.monotonic_ns()}"
        failure = run_forked(folder, make)
        if not failure or data is not None:
            shutil.rmtree(folder)
        return failure

    def keep_failures(self) -> Iterator[str]:
        """Keep an input of each kind of failure, and yield a line about it."""
        kinds: dict[str, list[int]] = {}
        for index, failure in sorted(self.failures.items()):
            kinds.setdefault(_signature(failure), []).append(index)
        for indices in kinds.values():
            failure = self.failures[indices[0]]
            folder = self._keep(indices[0], failure)
            yield f"{folder}, {len(indices)} times: {failure.kind}: {failure.line[:300]}"

    def _keep(self, index: int, expected: Failure) -> str:
        """Write the input with the fewest bytes that fails in the same way; return its folder."""
        target = KEPT / self.surface.name / f"{self.seed}_{index}"
        shutil.rmtree(target, ignore_errors=True)
        (source,) = self.folder.glob(f"{index}_*")
        pipes = (path.name for path in source.rglob("*") if path.is_fifo())
        shutil.copytree(source, target, symlinks=True, ignore=shutil.ignore_patterns(*pipes))
        path = target / "work" / json.loads((target / "command").read_text())["path"]

        def fails(data: bytes) -> bool:
            failure = self.read_input(index, data)
            return failure is not None and _signature(failure) == _signature(expected)

        if expected.kind != "hang" and path.is_file() and path.stat().st_size < _MAX_MINIMIZED:
            path.write_bytes(minimize(path.read_bytes(), fails, _MINIMIZE_SECONDS))
        return os.path.relpath(target)


def minimize(data: bytes, fails: Callable[[bytes], bool], seconds: float) -> bytes:
    """Return the fewest bytes that still fail, found by removing parts for some time."""
    end, size = time.monotonic() + seconds, len(data) // 2
    while size:
        at = 0
        while at < len(data) and time.monotonic() < end:
            shorter = data[:at] + data[at + size :]
            if shorter and fails(shorter):
                data = shorter
            else:
                at += size
        size //= 2
    return data


def keep_in_corpus(folder: Path) -> None:
    """Copy the command and the damaged file of a folder of .fuzz to the corpus."""
    target = CORPUS / folder.parent.name / folder.name
    path = Path("work", json.loads((folder / "command").read_text())["path"])
    (target / path).parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(folder / "command", target)
    if (folder / path).is_file():
        shutil.copy(folder / path, target / path)


def _signature(failure: Failure) -> str:
    return failure.kind + re.sub(r"[\d.]+|/\S*|'[^']*'", "", failure.line)[:60]


def measure(surfaces: list[Surface], seed: int, seconds: float, inputs: int) -> Iterator[Fuzzer]:
    """Yield the result of each surface, in `seconds` together and with so many inputs at least."""
    share = seconds / sum(surface.seconds for surface in surfaces)
    for surface in surfaces:
        with tempfile.TemporaryDirectory(prefix="fuzz-") as name:
            fuzzer = Fuzzer(surface, seed, Path(name).resolve())
            fuzzer.run(share * surface.seconds, inputs)
            yield fuzzer


def run() -> Iterator[tuple[str, float]]:
    """Yield the values for benchmarks/run.py."""
    for fuzzer in measure(load_surfaces(), 0, 0, 50):
        yield f"{fuzzer.surface.name}_failures (at most 0)", len(fuzzer.failures)


def main() -> int:
    """Print the failures, and their number by surface and kind."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10)
    parser.add_argument("--inputs", type=int, help="of each surface, in place of --minutes")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", nargs="+", type=Path, help="folders of .fuzz")
    surfaces = {surface.name: surface for surface in load_surfaces()}
    parser.add_argument("--only", nargs="+", choices=surfaces, default=list(surfaces))
    options = parser.parse_args()
    if options.keep:
        for folder in options.keep:
            keep_in_corpus(folder)
        return 0
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # before torch is imported
    chosen = [surfaces[name] for name in options.only]
    lines = [f"{'surface':14}{'tried':>6}" + "".join(f"{kind:>10}" for kind in KINDS)]
    seconds = 60 * options.minutes if options.inputs is None else 0
    is_failed = False
    for fuzzer in measure(chosen, options.seed, seconds, options.inputs or 0):
        count = Counter(failure.kind for failure in fuzzer.failures.values())
        numbers = "".join(f"{count[kind]:10}" for kind in KINDS)
        lines.append(f"{fuzzer.surface.name:14}{fuzzer.num_tried:6}{numbers}")
        is_failed |= bool(fuzzer.failures)
        for line in fuzzer.keep_failures():
            print(line, flush=True)
    print("\n".join(lines))
    return int(is_failed)


if __name__ == "__main__":
    sys.exit(main())
