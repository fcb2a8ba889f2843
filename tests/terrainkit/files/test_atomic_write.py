import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from terrainkit.errors import ExportError
from terrainkit.files.atomic_write import atomic_folder, atomic_write, temporary_folder

ERRORS = [ValueError, KeyboardInterrupt, OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))]


@pytest.fixture
def target(tmp_path):
    return tmp_path / "map.npz"


def write(path, *, then=None, overwrite=False):
    with atomic_write(path, overwrite=overwrite) as temporary:
        temporary.write_text("new")
        if then:
            then(temporary)


def write_folder(path, *, then=None):
    with atomic_folder(path) as folder:
        (folder / "new").touch()
        if then:
            then(folder)


def fail_with(error):
    def fail(_):
        raise error

    return fail


def write_sidecar(temporary):
    temporary.with_suffix(".json").write_text("{}")


def names(folder):
    return [each.name for each in folder.iterdir()]


def contents(folder):
    """Return the text of each file, and the names in each folder."""
    return {
        each.name: each.read_text() if each.is_file() else sorted(names(each))
        for each in folder.iterdir()
    }


@pytest.mark.parametrize("writer", [atomic_write, atomic_folder])
def test_target_appears_at_the_end_with_its_folders(tmp_path, writer):
    target = tmp_path / "new" / "map.npz"
    with pytest.raises(KeyboardInterrupt), writer(target):
        raise KeyboardInterrupt
    assert contents(tmp_path) == {}
    with writer(target) as temporary:
        (temporary / "meshes" if writer is atomic_folder else temporary).touch()
        assert not target.exists()
        assert temporary.name == target.name
    assert contents(tmp_path / "new") == {"map.npz": ["meshes"] if writer is atomic_folder else ""}


@pytest.mark.parametrize("error", ERRORS)
@pytest.mark.parametrize("old", [{}, {"map.npz": "old"}], ids=["new", "existing"])
def test_atomic_write_error_changes_nothing(target, error, old):
    if old:
        target.write_text("old")
    with pytest.raises((ValueError, KeyboardInterrupt, ExportError)) as caught:
        write(target, then=fail_with(error), overwrite=True)
    assert contents(target.parent) == old
    if isinstance(error, OSError):
        assert str(caught.value) == f"cannot write {target}: No space left on device"


@pytest.mark.parametrize(
    ("existing", "refused"),
    [({}, ""), ({"map.npz": "old"}, "map.npz"), ({"map.json": "old"}, "map.json")],
)
def test_atomic_write_replaces_file_and_sidecar_only_with_overwrite(target, existing, refused):
    for name, text in existing.items():
        target.with_name(name).write_text(text)
    if refused:
        with pytest.raises(ExportError, match=rf"{refused} exists; use another name"):
            write(target, then=write_sidecar)
        assert contents(target.parent) == existing
    write(target, then=write_sidecar, overwrite=bool(refused))
    assert contents(target.parent) == {"map.npz": "new", "map.json": "{}"}


def test_atomic_write_error_of_a_sidecar_has_the_path_of_the_user(tmp_path):
    """Such as a picture beside a report on a full disk."""
    target = tmp_path / "report.json"

    def write():
        with atomic_write(target) as temporary, atomic_write(temporary.with_suffix(".png")):
            raise OSError(28, "No space left on device")

    with pytest.raises(ExportError) as caught:
        write()
    assert str(caught.value) == f"cannot write {tmp_path / 'report.png'}: No space left on device"


def test_atomic_write_keeps_file_created_meanwhile(target):
    with pytest.raises(ExportError, match="exists"):
        write(target, then=lambda _: target.write_text("other"))
    assert contents(target.parent) == {"map.npz": "other"}


def link_to_null(path):
    path.symlink_to(os.devnull)


@pytest.mark.parametrize("overwrite", [False, True])
@pytest.mark.parametrize(
    ("make", "message"),
    [
        (Path.mkdir, r"cannot write .*map\.npz: it is a folder"),
        (os.mkfifo, "it exists and is not a regular file"),
        (link_to_null, "exists and is not a regular file"),
        (lambda path: path.symlink_to(path.name), "cannot write"),
    ],
    ids=["folder", "fifo", "device", "loop"],
)
def test_atomic_write_rejects_other_than_files(target, make, message, overwrite):
    make(target)
    before = target.lstat()
    with pytest.raises(ExportError, match=message):
        write(target, overwrite=overwrite)
    after = target.lstat()  # following a link changes the time of its last access
    for field in ("st_ino", "st_mode", "st_mtime_ns", "st_ctime_ns"):
        assert getattr(after, field) == getattr(before, field)
    assert names(target.parent) == ["map.npz"]


def test_writers_reject_file_as_folder(target):
    target.write_text("old")
    with pytest.raises(ExportError, match=r"cannot write .*: .*map\.npz is not a folder"):
        write(target / "new" / "map.npz")
    with pytest.raises(ExportError, match=r"cannot write .*map\.npz: "):
        write_folder(target)
    assert contents(target.parent) == {"map.npz": "old"}


def test_atomic_write_through_symlink_uses_its_name(target):
    target.symlink_to("blob")
    with atomic_write(target) as path:
        assert path.name == target.name
        path.write_text("new")
    assert contents(target.parent) == {"map.npz": "new", "blob": "new"}
    assert (target.is_symlink(), target.with_name("blob").is_symlink()) == (True, False)
    with pytest.raises(ExportError, match="exists"):
        write(target)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
@pytest.mark.parametrize(
    ("name", "message"),
    [("map.npz", "Permission denied"), ("new/map.npz", "cannot create a folder in ")],
)
def test_atomic_write_rejects_read_only_folder(tmp_path, name, message):
    tmp_path.chmod(0o500)
    with pytest.raises(ExportError, match=rf"cannot write .*: {message}"):
        write(tmp_path / name)
    tmp_path.chmod(0o700)


def test_atomic_write_respects_umask(target):
    before = os.umask(0o022)
    write(target)
    os.umask(before)
    assert target.stat().st_mode & 0o777 == 0o644


@pytest.fixture
def old_folder(tmp_path):
    (tmp_path / "robot").mkdir()
    (tmp_path / "robot/old").touch()
    return tmp_path / "robot"


def test_atomic_folder_replaces_folder(old_folder):
    write_folder(old_folder)
    assert contents(old_folder.parent) == {"robot": ["new"]}


@pytest.mark.parametrize("error", ERRORS)
def test_atomic_folder_error_keeps_old_folder(old_folder, error):
    with pytest.raises((ValueError, KeyboardInterrupt, ExportError)):
        write_folder(old_folder, then=fail_with(error))
    assert contents(old_folder.parent) == {"robot": ["old"]}


@pytest.mark.parametrize("error", ERRORS[1:])
def test_atomic_folder_interrupted_move_restores_folder(monkeypatch, old_folder, error):
    replace = Path.replace

    def move(path, target):
        if target == old_folder and path.name == "robot":  # the new folder; the old one is away
            raise error
        return replace(path, target)

    monkeypatch.setattr(Path, "replace", move)
    with pytest.raises((KeyboardInterrupt, ExportError)):
        write_folder(old_folder)
    assert contents(old_folder.parent) == {"robot": ["old"]}


def test_atomic_write_removes_folders_of_killed_processes(tmp_path):
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    foreign = tmp_path / ".terrainkit-otherhost-1-abc"
    foreign.mkdir()
    with temporary_folder(tmp_path) as own:
        assert own.stat().st_mode & 0o777 == 0o700
        stale = own.with_name(own.name.replace(f"-{os.getpid()}-", f"-{dead.pid}-"))
        stale.mkdir()
        (stale / "map.npz").write_text("half")
        with atomic_write(tmp_path / "a.txt") as path:
            path.write_text("whole")
        assert contents(tmp_path) == {"a.txt": "whole", foreign.name: [], own.name: []}
    assert not own.exists()
