import os
import subprocess
import sys
from pathlib import Path

import pytest

from terrainkit.errors import ExportError
from terrainkit_robots.onboarding.folder import check_folder, new_folder, write_files


def make(target, **options):
    with new_folder(target, **options) as folder:
        write_files(folder, {"robot.toml": b"new", "meshes/a.stl": b"mesh"})


@pytest.fixture
def robot(tmp_path):
    """Return the path of a folder that was written."""
    make(tmp_path / "robot")
    return tmp_path / "robot"


def contents(folder):
    """Return the content of each file below a folder."""
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


NEW = {"robot/robot.toml": b"new", "robot/meshes/a.stl": b"mesh"}


@pytest.mark.parametrize("exists", [False, True])
def test_new_or_empty_folder_gets_all_files(tmp_path, exists):
    if exists:
        (tmp_path / "robot").mkdir()
    make(tmp_path / "robot")
    assert contents(tmp_path) == NEW
    assert [path.name for path in tmp_path.iterdir()] == ["robot"]


def test_new_folder_removes_folders_of_killed_processes(tmp_path):
    killed = subprocess.Popen([sys.executable, "-c", ""])
    killed.wait()
    with new_folder(tmp_path / "a") as folder:
        name = folder.parent.name
    stale = tmp_path / name.replace(f"-{os.getpid()}-", f"-{killed.pid}-")
    (stale / "a").mkdir(parents=True)
    make(tmp_path / "b")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "b"]


def test_new_folder_requires_overwrite(tmp_path, robot):
    (robot / "robot.toml").write_text("mine")
    with pytest.raises(ExportError, match="exists; use another name, or `overwrite=True`"):
        make(robot)
    assert contents(tmp_path) == NEW | {"robot/robot.toml": b"mine"}
    make(robot, overwrite=True)
    assert contents(tmp_path) == NEW


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ({"thesis.tex": b"mine"}, "contains no robot.toml"),
        ({"robot.toml": b"", "notes.txt": b"mine"}, "also contains notes.txt"),
        ({"robot.toml": b"", "robot.xml.before": b"mine"}, r"also contains robot\.xml\.before"),
    ],
)
def test_new_folder_keeps_foreign_files(tmp_path, files, message):
    write_files(tmp_path / "robot", files)
    with pytest.raises(ExportError, match=message):
        make(tmp_path / "robot", overwrite=True)
    assert contents(tmp_path / "robot") == files
    assert [path.name for path in tmp_path.iterdir()] == ["robot"]


def test_new_folder_keeps_old_folder_after_error(tmp_path, robot, monkeypatch):
    with pytest.raises(RuntimeError), new_folder(robot, overwrite=True):
        raise RuntimeError
    assert contents(tmp_path) == NEW
    move = Path.replace

    def refuse(path, target):
        if path.name == "robot" and path.parent != tmp_path:
            raise OSError("no")
        return move(path, target)

    monkeypatch.setattr(Path, "replace", refuse)
    with pytest.raises(ExportError, match="cannot write"):
        make(robot, overwrite=True)
    assert contents(tmp_path) == NEW


def test_new_folder_keeps_files_that_appear_meanwhile(robot):
    with (
        pytest.raises(ExportError, match=r"also contains notes\.txt"),
        new_folder(robot, overwrite=True),
    ):
        (robot / "notes.txt").write_text("mine")
    assert contents(robot).keys() == {"robot.toml", "meshes/a.stl", "notes.txt"}


@pytest.mark.parametrize(
    ("target", "message"),
    [
        ("file/robot", "file is not a folder"),
        ("file", "is not a folder"),
        ("link", "is not a folder"),
    ],
)
def test_check_folder_rejects_invalid_target(tmp_path, target, message):
    (tmp_path / "file").write_text("")
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    with pytest.raises(ExportError, match=message):
        check_folder(tmp_path / target, overwrite="/" not in target)


@pytest.mark.parametrize("name", ["../outside", "/etc/outside", "a/../../outside"])
def test_path_outside_of_the_folder_is_rejected(tmp_path, name):
    with pytest.raises(ExportError, match="outside"), new_folder(tmp_path / "robot") as folder:
        write_files(folder, {"robot.toml": b"new", name: b""})
    assert list(tmp_path.iterdir()) == []
