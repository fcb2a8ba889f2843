from pathlib import Path

import pytest

from terrainkit.errors import ExportError
from terrainkit_robots.onboarding.folder import check_folder, new_folder, write_files


def names_in(folder):
    return [path.name for path in folder.iterdir()]


def make(target, **options):
    with new_folder(target, **options) as folder:
        write_files(folder, {"robot.toml": b"new", "meshes/a.stl": b"mesh"})


def test_the_folder_is_there_whole(tmp_path):
    make(tmp_path / "robot")
    assert (tmp_path / "robot/robot.toml").read_bytes() == b"new"
    assert (tmp_path / "robot/meshes/a.stl").read_bytes() == b"mesh"
    assert names_in(tmp_path) == ["robot"]


def test_or_not_at_all(tmp_path):
    with pytest.raises(ExportError, match="outside"), new_folder(tmp_path / "robot") as folder:
        write_files(folder, {"robot.toml": b"new", "../outside": b""})
    assert names_in(tmp_path) == []


def test_one_that_exists_is_not_replaced_unasked(tmp_path):
    make(tmp_path / "robot")
    (tmp_path / "robot/robot.toml").write_text("mine")
    with pytest.raises(ExportError, match="exists; another name would do, or --overwrite"):
        make(tmp_path / "robot")
    assert (tmp_path / "robot/robot.toml").read_text() == "mine"
    make(tmp_path / "robot", overwrite=True)
    assert (tmp_path / "robot/robot.toml").read_text() == "new"


def test_an_empty_folder_is_filled(tmp_path):
    (tmp_path / "robot").mkdir()
    make(tmp_path / "robot")
    assert (tmp_path / "robot/robot.toml").exists()


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ({"thesis.tex": "mine"}, "holds no robot.toml"),
        ({"robot.toml": "", "notes.txt": "mine"}, "also holds notes.txt"),
        ({"robot.toml": "", "robot.xml.before": "mine"}, r"also holds robot\.xml\.before"),
    ],
)
def test_what_onboarding_did_not_write_is_never_replaced(tmp_path, files, message):
    folder = tmp_path / "robot"
    folder.mkdir()
    for name, text in files.items():
        (folder / name).write_text(text)
    with pytest.raises(ExportError, match=message):
        make(folder, overwrite=True)
    assert {name: (folder / name).read_text() for name in files} == files
    assert names_in(tmp_path) == ["robot"]


def test_a_replaced_folder_keeps_the_old_one_if_the_new_one_fails(tmp_path):
    make(tmp_path / "robot")
    with pytest.raises(RuntimeError), new_folder(tmp_path / "robot", overwrite=True):
        raise RuntimeError
    assert (tmp_path / "robot/robot.toml").read_bytes() == b"new"


def test_a_disk_that_does_not_take_the_new_folder_keeps_the_old_one(tmp_path, monkeypatch):
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


def test_there_has_to_be_a_place(tmp_path):
    with pytest.raises(ExportError, match="there is no folder"):
        check_folder(tmp_path / "no/robot", overwrite=False)
    (tmp_path / "file").write_text("")
    with pytest.raises(ExportError, match="not a folder"):
        check_folder(tmp_path / "file", overwrite=True)
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    with pytest.raises(ExportError, match="not a folder"):
        check_folder(tmp_path / "link", overwrite=True)


@pytest.mark.parametrize("name", ["../outside", "/etc/outside", "a/../../outside"])
def test_nothing_is_written_outside(tmp_path, name):
    (tmp_path / "robot").mkdir()
    with pytest.raises(ExportError, match="outside"):
        write_files(tmp_path / "robot", {name: b""})
    assert names_in(tmp_path) == ["robot"]
