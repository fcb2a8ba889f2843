"""Type the blocks of each page into a shell and a Python session, from top to bottom.

Each page starts in an empty folder, as a reader without files does. A block whose first line is a
comment with the name of a file is that file. A block of text is what a command before it prints;
`...` stands for any text. The blocks of frameworks run in tests/frameworks, which names them with
`page_block("PAGE.md", "TEXT")`.
"""

import ast
import os
import re
import shlex
import signal
import socket
import subprocess
import sys
import tomllib
import warnings
from enum import Enum
from itertools import chain
from pathlib import Path

import numpy as np
import pytest

from terrainkit import TerrainkitWarning
from terrainkit_cli.main import main
from tests.frameworks.pages import DOCS, ROOT, page_blocks
from tests.tables import read_table

pytest.importorskip("torch", reason="the extra `train` is not installed")


SHELL = ("sh", "bash")
PAGES = [
    page
    for page in ("README.md", *sorted(path.name for path in DOCS.glob("*.md")))
    if {"python", *SHELL} & {language for language, _ in page_blocks(page)}
]


class Reason(Enum):
    """Why a block runs nowhere."""

    DOWNLOADS = "it clones repositories"
    INSTALLS = "it installs a framework; tests/frameworks/run.py installs the same packages"


EXEMPT = {
    ("field_robots.md", "git clone"): Reason.DOWNLOADS,
    ("isaaclab.md", "pip install isaaclab"): Reason.INSTALLS,
    ("mjlab.md", "pip install mjlab"): Reason.INSTALLS,
    ("small_robot.md", "git clone"): Reason.DOWNLOADS,
    ("small_robot.md", "microduck_runtime --model"): Reason.DOWNLOADS,
}
"""The blocks that run nowhere, by page and a text in them."""

NEVER_EXEMPT = ("README", "index", "importing", "onboarding", "training", "exported_policy")
"""Pages that newcomers read first."""

FRAMEWORK_TESTS = (
    *(ROOT / "tests/frameworks").glob("*.py"),
    ROOT / "tests/terrainkit/export/test_legged_gym_export.py",
)
FRAMEWORK_BLOCKS = [
    found
    for path in FRAMEWORK_TESTS
    for found in re.findall(r'page_block\(\s*"(\S+?)",\s*"([^"]+)"\s*\)', path.read_text())
]
"""The blocks that run in the tests of a framework, by page and a text in them."""

FRAMEWORK_PAGES = (
    *("isaaclab.md", "legged_gym.md", "leggedgym_ex.md", "mjlab.md", "mujoco.md", "newton.md"),
    *("genesis.md", "pybullet.md", "playground.md", "gymnasium.md", "onboarding.md", "levels.md"),
)

REPLACED = read_table(__file__, "replaced")
"""What is typed in place of parts of the pages: patterns and their replacements."""

FINDS = ("check-robot", "check-policy", "feasibility")
"""Commands whose exit code is 1 if they find something."""

SERVES = ("demo", "view")
"""Commands that run until they are ended."""

AFTERWARD = read_table(__file__, "afterward")
"""Expressions that are true after a page, with the names of its Python session."""


def blocks_of_pages():
    """Return the shell and Python blocks of all pages, as pairs of page and text."""
    blocks = ((page, *found) for page in PAGES for found in page_blocks(page))
    return [(page, block) for page, language, block in blocks if language in (*SHELL, "python")]


def test_at_most_a_tenth_of_the_blocks_runs_nowhere():
    blocks = blocks_of_pages()
    elsewhere = [*EXEMPT, *FRAMEWORK_BLOCKS]
    for page, text in elsewhere:
        assert sum(name == page and text in block for name, block in blocks) == 1, (page, text)
    assert len(EXEMPT) <= len(blocks) / 10
    assert not {page.removesuffix(".md") for page, _ in EXEMPT} & set(NEVER_EXEMPT)
    assert {page for page, _ in FRAMEWORK_BLOCKS} <= set(FRAMEWORK_PAGES)


def test_each_replacement_is_for_a_line_of_a_page():
    lines = [line for _, block in blocks_of_pages() for line in commands(block, replaced=())]
    for pattern, _ in REPLACED:
        assert any(re.search(pattern, line) for line in lines), pattern


def test_blocks_import_what_the_adapters_define():
    text = "\n".join(block for _, block in blocks_of_pages())
    imports = re.findall(r"^from (terrainkit\.integrations\.\w+) import (.+)$", text, re.MULTILINE)
    assert len(imports) == 11, "count the import of the new adapter here"
    for module, names in imports:
        path = ROOT / f"{module.replace('.', '/')}.py"
        nodes = ast.parse(path.read_text()).body
        imported = chain.from_iterable(
            node.names for node in nodes if isinstance(node, ast.ImportFrom)
        )
        defined = {getattr(node, "name", "") for node in (*nodes, *imported)}
        assert set(names.split(", ")) <= defined, module


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Type in an empty folder, whose modules Python finds."""
    for name in ("BROWSER", "DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    programs = tmp_path / "programs"
    programs.mkdir()
    terrainkit = programs / "terrainkit"
    terrainkit.write_text(f'#!/bin/sh\nexec {sys.executable} -m terrainkit_cli.main "$@"\n')
    terrainkit.chmod(0o755)
    path = os.pathsep.join([str(programs), str(Path(sys.executable).parent), os.environ["PATH"]])
    monkeypatch.setenv("PATH", path)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(str(ROOT / part) for part in PACKAGES))
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    monkeypatch.setenv("COLUMNS", "100")
    (tmp_path / "page").mkdir()
    monkeypatch.chdir(tmp_path / "page")
    monkeypatch.syspath_prepend(tmp_path / "page")


PACKAGES = ("", "robots", "cli")
"""Folders of the packages in the repository."""


@pytest.fixture
def forget(own_registry, own_tasks):  # noqa: ARG001
    """Forget the tasks, terrains and modules of a page."""
    modules = set(sys.modules)
    yield
    for name in set(sys.modules) - modules:
        if "/page/" in (getattr(sys.modules[name], "__file__", None) or ""):
            del sys.modules[name]


def replace(text, replaced=REPLACED):
    for pattern, replacement in replaced:
        text = re.sub(pattern, replacement, text)
    return text


def commands(block, replaced=REPLACED):
    """Return the commands of a shell block."""
    for line in block.replace("\\\n", " ").splitlines():
        line = re.sub(r"(^|\s)#.*", "", line).strip()
        yield from (replace(command, replaced) for command in line.split(" && ") if command)


def check_pip_install(words):
    """Check that what is installed exists; .ci/readme and the jobs of CI install it."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    dependencies = {re.match(r"[\w-]+", text)[0] for text in project["dependencies"]}
    for target in (word for word in words if not word.startswith("-")):
        path, _, extras = target.rstrip("]").partition("[")
        assert path == "." or path in dependencies, target
        assert set(filter(None, extras.split(","))) <= set(project["optional-dependencies"]), target


def serve(words):
    """Start a command that serves a page, and end it when it has printed the address."""
    with socket.create_server(("localhost", 0)) as free:  # other tests may start at port 8080
        port = str(free.getsockname()[1])
    with subprocess.Popen(
        [sys.executable, "-m", "terrainkit_cli.main", *words, "--port", port],
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        line = process.stdout.readline()
        process.terminate()  # a shell lets its background jobs ignore SIGINT
    assert line.startswith(f"http://localhost:{port} shows "), line
    assert process.returncode in (0, 128 + signal.SIGTERM)
    return line


def type_command(command, capsys):
    """Run a command, and return what it prints."""
    words = [
        name
        for word in shlex.split(command)
        for name in (sorted(map(str, Path().glob(word))) if "*" in word else [word])
    ]
    if words[:2] == ["pip", "install"]:
        check_pip_install(words[2:])
        return ""
    if words[0] == "terrainkit" and words[1] in SERVES:
        return serve(words[1:])
    # This process has imported the plug-in as a module.
    if words[0] != "terrainkit" or "--plugin" in words:
        done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"{command}: {done.stderr}"
        return done.stdout
    with warnings.catch_warnings():
        warnings.simplefilter("always", TerrainkitWarning)
        code = main(words[1:])  # a process takes seconds to import torch
    printed = capsys.readouterr()
    assert code == 0 or (code == 1 and words[1] in FINDS), f"{command}: {printed.err}"
    return printed.out


def type_python(block, title, names, capsys):
    """Run a block in a Python session, and return what it prints."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TerrainkitWarning)
        exec(compile(replace(block), title, "exec"), names)
    return capsys.readouterr().out


def is_shown(text, printed):
    """Return whether a text was printed; spaces do not count."""
    parts = [re.escape(" ".join(part.split())) for part in text.split("...")]
    return re.search(" ?.*? ?".join(parts), " ".join(printed.split())) is not None


@pytest.mark.usefixtures("folder", "forget")
@pytest.mark.parametrize("page", PAGES)
def test_blocks_run_from_top_to_bottom(page, capsys):
    names, printed, failures = {"__name__": "__main__"}, "", []
    for number, (language, block) in enumerate(page_blocks(page), start=1):
        title = f"{page}, block {number} ({language})"
        if any(name == page and text in block for name, text in (*EXEMPT, *FRAMEWORK_BLOCKS)):
            continue
        try:
            if file := re.match(r"# (\w+\.\w+)\n", block):
                Path(file[1]).write_text(block)
            elif language in SHELL:
                for command in commands(block):
                    printed += type_command(command, capsys)
            elif language == "python":
                printed += type_python(block, title, names, capsys)
            elif language == "text" and printed:
                assert is_shown(block, printed), f"not printed; printed was:\n{printed}"
        except Exception as error:
            failures.append(f"{title}: {type(error).__name__}: {error}")
    assert not failures, "\n".join(failures)
    names |= {"Path": Path, "np": np, "block": dict(page_blocks(page)).get}
    for expression in AFTERWARD.get(page, ()):
        assert eval(expression, names), expression
