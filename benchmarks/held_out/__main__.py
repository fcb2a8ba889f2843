"""Measure the recall of check-robot on the held-out defects: `python -m benchmarks.held_out`."""

import argparse
import json
import re
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from operator import itemgetter
from pathlib import Path
from random import Random
from typing import Any

from lxml import etree

from benchmarks.mutants.defect import Defect, load_defects
from benchmarks.mutants.edits import apply_edits
from benchmarks.mutants.mutant import Mutant
from benchmarks.mutants.robot_files import ROBOT_FILES, ROOT, robot_folder

SEVERITIES = ("error", "warning")
ORIGINALS: dict[str, list[dict[str, Any]]] = {}


def read(robot: str) -> Any:
    """Return the tree of a robot; the mesh that go2.xml lacks is taken out of it."""
    tree = etree.parse(ROBOT_FILES[robot], etree.XMLParser(huge_tree=True)).getroot()
    if robot == "go2.xml":
        for element in tree.xpath("//*[@file='base_4.obj' or @mesh='base_4']"):
            element.getparent().remove(element)
    return tree


def check(robot: str, mutant: Mutant) -> list[dict[str, Any]] | None:
    """Return what check-robot finds in a mutant, written next to links to the robot's meshes.

    The command is called, not the Python API: it has been the same for longer.

    Returns:
        The findings of the JSON report; None if the command refuses the file.
    """
    from terrainkit_cli.main import main as terrainkit

    source = ROBOT_FILES[robot]
    top = robot_folder(source)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / top.name
        path = folder / source.relative_to(top)
        path.parent.mkdir(parents=True)
        for item in top.iterdir():
            if item.is_dir() and item != source.parent:
                (folder / item.name).symlink_to(item)
        text = etree.tostring(mutant.root, encoding="unicode")
        header = '<?xml version="1.0" encoding="utf-8"?>\n'
        path.write_bytes(mutant.rewrite((header + text).encode()))
        for file, content in mutant.files.items():
            (path.parent / file).write_bytes(content)
        report = Path(name) / "report.json"
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
            code = terrainkit(["check-robot", str(path), "--format", "json", "-o", str(report)])
        return None if code == 2 else json.loads(report.read_text())["findings"]


def is_about(finding: Any, names: Sequence[str], about: str) -> bool:
    """Return whether a finding names a broken element, or matches `about`."""
    text = f"{finding['subject']}\n{finding['message']}"
    words = "|".join(rf"(?<![\w-]){re.escape(name)}(?![\w-])" for name in names)
    return any(p and re.search(p, text, re.IGNORECASE) for p in (words, about))


def measure(defect: Defect, seed: int) -> Iterator[dict[str, Any]]:
    """Yield the result for each robot that a defect is applied to."""
    for robot in defect.robots:
        mutant = Mutant(read(robot), Random(f"{defect.title} {robot} {seed}"), ROBOT_FILES[robot])
        names = defect.apply(mutant)
        about = mutant.fill(defect.about)
        result = {"kind": defect.title, "family": defect.family, "robot": robot, "names": names}
        found = check(robot, mutant)
        if found is None:
            yield result | {"found": "refused", "rules": []}
            continue
        key = robot + defect.title * bool(defect.prepare)
        if key not in ORIGINALS:
            original = Mutant(read(robot), Random(0), ROBOT_FILES[robot])
            apply_edits(original, defect.prepare)
            ORIGINALS[key] = check(robot, original) or []
        identity = itemgetter("code", "subject", "severity")
        known = {identity(f) for f in ORIGINALS[key] if is_about(f, names, about)}
        new = [f for f in found if is_about(f, names, about) and identity(f) not in known]
        severities = {f["severity"] for f in new}
        level = next((s for s in (*SEVERITIES, "note") if s in severities), "")
        rules = sorted({f"{f['code']} {f['severity']}" for f in new})
        yield result | {"found": level, "rules": rules}


def table(results: list[dict[str, Any]]) -> str:
    """Return the recall by family."""
    lines = [f"{'family':<12} kinds mutants found notes recall"]
    families = dict.fromkeys(r["family"] for r in results)
    for family in (*families, "all"):
        rows = [r for r in results if family in (r["family"], "all")]
        count = Counter(r["found"] for r in rows)
        found = count["error"] + count["warning"] + count["refused"]
        kinds = len({r["kind"] for r in rows})
        lines.append(
            f"{family:<12} {kinds:5} {len(rows):7} {found:5} {count['note']:5} "
            f"{found / len(rows):6.0%}"
        )
    return "\n".join(lines)


def main() -> None:
    """Run the sets that the command line names, and print the recall of each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sets", nargs="*", default=["a"], help="a, b or both")
    parser.add_argument("--tree", type=Path, default=ROOT, help="the terrainkit tree to measure")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="regular expression for the kinds")
    parser.add_argument("--output", type=Path, help="write the results as JSON")
    options = parser.parse_args()
    sys.path[:0] = [str(options.tree / part) for part in ("", "robots", "cli")]
    everything = {}
    for name in options.sets:
        defects = load_defects(Path(__file__).parent / f"set_{name}.toml")
        chosen = [d for d in defects if re.search(options.only, d.title)]
        results = [r for d in chosen for r in measure(d, options.seed)]
        everything[name] = results
        print(f"set {name.upper()}\n{table(results)}\nmissed:")
        for r in results:
            if r["found"] in ("", "note"):
                print(f"  {r['family']:<12} {r['kind']} {r['robot']} {r['found']}")
    if options.output:
        options.output.write_text(json.dumps(everything, indent=1))


if __name__ == "__main__":
    main()
