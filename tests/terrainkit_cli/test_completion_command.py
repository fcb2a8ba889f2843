import os
import shutil
import subprocess
import sys

import pytest

from tests.tables import read_table

COMPLETE = read_table(__file__, "complete")


@pytest.fixture
def completed(tmp_path, monkeypatch):
    """Return the completions of a line by bash, in an empty folder."""
    pytest.importorskip("argcomplete")
    if shutil.which("bash") is None:
        pytest.skip("no bash on this system")
    script = tmp_path / "bin" / "terrainkit"
    script.parent.mkdir()
    script.write_text(f'#!/bin/sh\nexec {sys.executable} -m terrainkit_cli.main "$@"\n')
    script.chmod(0o700)
    monkeypatch.setenv("PATH", f"{script.parent}{os.pathsep}{os.environ['PATH']}")
    (tmp_path / "empty").mkdir()

    def complete(line):
        words = ["bash", "-c", f'{COMPLETE}complete_line "$0"', line]
        run = subprocess.run(
            words, cwd=tmp_path / "empty", capture_output=True, text=True, check=True
        )
        assert run.stderr == ""
        return run.stdout.split()

    return complete


@pytest.mark.parametrize(("line", "expected"), read_table(__file__, "completion_in_bash"))
def test_completion_in_bash(completed, line, expected):
    assert completed(line) == expected


def test_completion_offers_files(completed, tmp_path):
    (tmp_path / "empty" / "map.npz").touch()
    assert completed("terrainkit info ") == ["map.npz"]
    assert completed("terrainkit export map.npz -o ma") == ["map.npz"]


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_prints_code(terrainkit, shell):
    pytest.importorskip("argcomplete")
    run = terrainkit("completion", shell)
    assert (run.returncode, run.stderr) == (0, "")
    assert "_ARGCOMPLETE" in run.stdout


def test_completion_rejects_other_shells(rejected):
    assert "SHELL: got 'tcsh'; expected one of: bash, zsh, fish" in rejected("completion tcsh")
