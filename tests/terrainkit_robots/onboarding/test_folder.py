import os
import subprocess
import sys
from pathlib import Path

import pytest

from terrainkit.errors import ExportError
from terrainkit_robots.onboarding.folder import check_folder, new_folder, write_files


def file_names(folder):
    return [path.name for path in folder.iterdir()]


def make(target, **options):
    with new_folder(target, **options) as folder:
        write_files(folder, {"robot.toml": b"new", "meshes/a.stl": b"mesh"})


def test_new_folder_writes_all_files(tmp_path):
    make(tmp_path / "robot")
    assert (tmp_path / "robot/robot.toml").read_bytes() == b"new"
    assert (tmp_path / "robot/meshes/a.stl").read_bytes() == b"mesh"
    assert file_names(tmp_path) == ["robot"]


def test_new_folder_writes_nothing_after_error(tmp_path):
    with pytest.raises(ExportError, match="outside"), new_folder(tmp_path / "robot") as folder:
        write_files(folder, {"robot.toml": b"new", "../outside": b""})
    assert file_names(tmp_path) == []


def test_new_folder_removes_folders_of_killed_processes(tmp_path):
    killed = subprocess.Popen([sys.executable, "-c", ""])
    killed.wait()
    with new_folder(tmp_path / "a") as folder:
        name = folder.parent.name
    stale = tmp_path / name.replace(f"-{os.getpid()}-", f"-{killed.pid}-")
    (stale / "a").mkdir(parents=True)
    make(tmp_path / "b")
    assert sorted(file_names(tmp_path)) == ["a", "b"]


def test_new_folder_requires_overwrite(tmp_path):
    make(tmp_path / "robot")
    (tmp_path / "robot/robot.toml").write_text("mine")
    with pytest.raises(ExportError, match="exists; use another name, or --overwrite"):
        make(tmp_path / "robot")
    assert (tmp_path / "robot/robot.toml").read_text() == "mine"
    make(tmp_path / "robot", overwrite=True)
    assert (tmp_path / "robot/robot.toml").read_text() == "new"


def test_new_folder_accepts_empty_folder(tmp_path):
    (tmp_path / "robot").mkdir()
    make(tmp_path / "robot")
    assert (tmp_path / "robot/robot.toml").exists()


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ({"thesis.tex": "mine"}, "contains no robot.toml"),
        ({"robot.toml": "", "notes.txt": "mine"}, "also contains notes.txt"),
        ({"robot.toml": "", "robot.xml.before": "mine"}, r"also contains robot\.xml\.before"),
    ],
)
def test_new_folder_keeps_foreign_files(tmp_path, files, message):
    folder = tmp_path / "robot"
    folder.mkdir()
    for name, text in files.items():
        (folder / name).write_text(text)
    with pytest.raises(ExportError, match=message):
        make(folder, overwrite=True)
    assert {name: (folder / name).read_text() for name in files} == files
    assert file_names(tmp_path) == ["robot"]


def test_new_folder_keeps_old_folder_after_error(tmp_path):
    make(tmp_path / "robot")
    with pytest.raises(RuntimeError), new_folder(tmp_path / "robot", overwrite=True):
        raise RuntimeError
    assert (tmp_path / "robot/robot.toml").read_bytes() == b"new"


def test_new_folder_keeps_old_folder_if_rename_fails(tmp_path, monkeypatch):
    make(tmp_path / "robot")
    move = Path.replace

    def refuse(path, target):
        if path.name == "robot" and path.parent != tmp_path:
            raise OSError("no")
        return move(path, target)

    monkeypatch.setattr(Path, "replace", refuse)
    with pytest.raises(ExportError, match="cannot write"):
        make(tmp_path / "robot", overwrite=True)
    assert (tmp_path / "robot/robot.toml").read_bytes() == b"new"


def test_check_folder_rejects_invalid_target(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ExportError, match="file is not a folder"):
        check_folder(tmp_path / "file/robot", overwrite=False)
    with pytest.raises(ExportError, match="is not a folder"):
        check_folder(tmp_path / "file", overwrite=True)
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    with pytest.raises(ExportError, match="is not a folder"):
        check_folder(tmp_path / "link", overwrite=True)


@pytest.mark.parametrize("name", ["../outside", "/etc/outside", "a/../../outside"])
def test_write_files_rejects_path_outside_folder(tmp_path, name):
    (tmp_path / "robot").mkdir()
    with pytest.raises(ExportError, match="outside"):
        write_files(tmp_path / "robot", {name: b""})
    assert file_names(tmp_path) == ["robot"]
