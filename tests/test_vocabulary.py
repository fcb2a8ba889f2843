"""Reject retired names and Sphinx markup; docs/glossary.md has the terms to use instead."""

import ast
import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
SPHINX = re.compile(r":[a-z]+:`|\.\. [a-z]+::")
RETIRED = tomllib.loads((ROOT / "tests/retired_names.toml").read_text())


def names(path):
    yield path.stem
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.name
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            yield node.target.id
        elif isinstance(node, ast.arg):
            yield node.arg


def test_names_are_not_retired(tmp_path):
    folders = ("terrainkit", "robots", "cli")
    files = [path for folder in folders for path in (ROOT / folder).rglob("*.py")]
    retired = {
        f"{path.relative_to(ROOT)}: {name}": RETIRED[name.strip("_")]
        for path in files
        for name in names(path)
        if name.strip("_") in RETIRED
    }
    assert files
    assert not retired
    (tmp_path / "a.py").write_text("class Careers:\n    x: int\n    def _told(self, plot): ...\n")
    assert set(names(tmp_path / "a.py")) == {"a", "Careers", "x", "_told", "self", "plot"}


def test_sources_have_no_sphinx_markup():
    """The site and editors show docstrings as Markdown, in which it is noise."""
    folders = ("terrainkit", "robots", "cli", "docs")
    files = [path for folder in folders for path in (ROOT / folder).rglob("*.py")]
    marked = [str(path) for path in files if SPHINX.search(path.read_text(encoding="utf-8"))]
    assert files
    assert not marked
    for markup in (":func:`run`", ".. math:: x"):
        assert SPHINX.search(markup)
