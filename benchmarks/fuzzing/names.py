"""Robots whose names are code in the files that `onboard` writes."""

import ast
import html
import json
import re
import tomllib
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

from fuzzing.forked import Command

_ROBOT = "quadruped"
"""Name of the robot, which becomes part of names in the code."""

_NAME = re.compile(r'(?<=name=")[^"/]+(?=")')


def prepare_name(line: str, name: str, rng: Random) -> Command:
    """Write robot.urdf, the robot of plain/ with another name, and return how to onboard it.

    Args:
        line: The command line that reads `{}` and writes the folder `out`.
        name: A hostile name: it replaces one name of the robot, or is its ending.
        rng: Chooses the name of the robot.
    """
    text = Path("plain/robot.urdf").read_text()
    old = rng.choice(sorted({*_NAME.findall(text)}))
    base = old if old == _ROBOT else rng.choice(("", old))
    for path, new in (("robot.urdf", base + name), ("other.urdf", f"{base}x")):
        quoted = html.escape(new).replace("\n", "&#10;").replace("\t", "&#9;")
        Path("plain", path).write_text(text.replace(f'"{old}"', f'"{quoted}"'))
    words = line.replace("{}", "plain/robot.urdf").split()
    check = partial(_compare, line.replace("{}", "plain/other.urdf").replace("-o out", "-o out_2"))
    return Command(words=words, path=Path("plain/robot.urdf"), check=check)


def _compare(line: str) -> str:
    """Return which file of `out` has code that it does not have with a harmless name."""
    from terrainkit_cli.main import main

    if main(line.split()):
        return ""
    expected: set[str] = set()
    for path in Path("out_2").rglob("*.*"):
        expected |= _code(path)
    for path in sorted(Path("out").rglob("*.*")):
        try:
            parts = _code(path)
        except Exception as error:  # of parsers
            return f"{path} cannot be parsed: {error!r:.200}"
        added = [part for part in parts - expected if _ROBOT not in part.lower()]
        if added:
            return f"{path}: the name adds {added}"
    return ""


def _code(path: Path) -> set[str]:
    """Return the parts of a file that are no text or number of its author."""
    import lxml.etree
    import yaml

    if path.suffix == ".py":
        return {*_python(ast.parse(path.read_text()))}
    if path.suffix in (".xml", ".urdf"):
        elements = lxml.etree.parse(path).iter()
        return {f"{element.tag} {sorted(element.attrib)}" for element in elements}
    read = {".toml": tomllib.loads, ".json": json.loads, ".yaml": yaml.safe_load}
    return {*_types(read[path.suffix](path.read_text()))} if path.suffix in read else set()


def _python(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        names = (getattr(node, key, "") for key in ("id", "attr", "name", "arg"))
        yield " ".join((type(node).__name__, *map(str, names)))


def _types(value: Any) -> Iterator[str]:
    yield type(value).__name__
    if isinstance(value, dict | list):
        for part in value.values() if isinstance(value, dict) else value:
            yield from _types(part)
