import shlex
import shutil
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path

import pytest

from terrainkit import TerrainkitWarning
from terrainkit_cli.main import main
from terrainkit_robots.rl.tasks import get_task

Run = subprocess.CompletedProcess[str]


@pytest.fixture
def terrainkit_process(tmp_path) -> Callable[..., Run]:
    """Run `terrainkit` in a process of its own, in an empty folder."""

    def run(*words: object) -> Run:
        return subprocess.run(
            [sys.executable, "-m", "terrainkit_cli.main", *map(str, words)],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )

    return run


@pytest.fixture
def terrainkit(tmp_path, monkeypatch, run_main) -> Callable[..., Run]:
    """Run `terrainkit` in this process, in an empty folder: a process takes 0.5 s to start."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")

    def run(*words: object) -> Run:
        with warnings.catch_warnings():
            warnings.simplefilter("always", TerrainkitWarning)
            return run_main(*words)

    return run


@pytest.fixture
def run_main(capsys) -> Callable[..., Run]:
    """Run `terrainkit` in this process: torch takes seconds to import."""

    def run(*words: object) -> Run:
        capsys.readouterr()
        code = main([str(word) for word in words])
        captured = capsys.readouterr()
        return Run(words, code, captured.out, captured.err)

    return run


@pytest.fixture
def rejected(terrainkit) -> Callable[..., str]:
    """Return a function that runs a command that fails, and returns its error, which is one line.

    The words may be one text, as in a shell.
    """

    def run(*words: object) -> str:
        if len(words) == 1:
            words = tuple(shlex.split(str(words[0])))
        done = terrainkit(*words)
        prefix = "terrainkit: error: "
        assert (done.returncode, done.stdout) == (2, ""), done
        assert done.stderr.startswith(prefix)
        assert done.stderr.count("\n") == 1
        return done.stderr.removeprefix(prefix)

    return run


@pytest.fixture
def small_map(terrainkit) -> str:
    """Generate a small map with four terrains, and return its name."""
    run = terrainkit("generate", "-o", "small.npz", *SMALL)
    assert run.returncode == 0, run.stderr
    return "small.npz"


@pytest.fixture
def walking(tmp_path) -> Path:
    """Return the folder of a run `walk` of a quadruped that walks, with two checkpoints."""
    shipped = get_task("quadruped").trained_run
    (policy,) = shipped.glob("model_*.pt")
    folder = tmp_path / "walk"
    shutil.copytree(shipped, folder, ignore=shutil.ignore_patterns(policy.name))
    for iteration in (3, 7):
        shutil.copy(policy, folder / f"model_{iteration}.pt")
    return folder


@pytest.fixture
def run_beside_walk(walking, monkeypatch, run_main) -> Callable[..., tuple[int, str, str]]:
    """Run `terrainkit` in a folder with a run `walk`; return exit code, output and errors."""
    monkeypatch.chdir(walking.parent)

    def run(*words: object) -> tuple[int, str, str]:
        done = run_main(*words)
        return done.returncode, done.stdout, done.stderr

    return run


SMALL = ("--rows", 2, "--cols", 5, "--preset", "rough", "--border", 1, "--patch-size", 8, 6)
