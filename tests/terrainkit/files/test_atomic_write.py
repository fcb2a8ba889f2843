import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from terrainkit.errors import ExportError
from terrainkit.files.atomic_write import atomic_folder, atomic_write, temporary_folder


@pytest.fixture
def target(tmp_path):
    return tmp_path / "map.npz"


def write(path, *, then=None, overwrite=False):
    with atomic_write(path, overwrite=overwrite) as temporary:
        temporary.write_text("new")
        if then:
            then(temporary)


def fail_with(error):
    def fail(_):
        raise error

    return fail


def write_sidecar(temporary):
    temporary.with_suffix(".json").write_text("{}")


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_atomic_write_creates_file_at_the_end(target):
    with atomic_write(target) as temporary:
        temporary.write_text("new")
        assert not target.exists()
        assert temporary.name == target.name
    assert target.read_text() == "new"
    assert names(target.parent) == ["map.npz"]


def test_atomic_write_keeps_existing_file(target):
    target.write_text("old")
    with pytest.raises(ExportError, match=r"map\.npz exists"):
        write(target)
    assert target.read_text() == "old"
    assert names(target.parent) == ["map.npz"]


def test_atomic_write_replaces_with_overwrite(target):
    target.write_text("old")
    write(target, overwrite=True)
    assert target.read_text() == "new"


def test_atomic_write_keeps_file_created_meanwhile(target):
    with pytest.raises(ExportError, match="exists"):
        write(target, then=lambda _: target.write_text("other"))
    assert target.read_text() == "other"
    assert names(target.parent) == ["map.npz"]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, OSError])
def test_atomic_write_error_leaves_nothing(target, error):
    with pytest.raises((error, ExportError)):
        write(target, then=fail_with(error))
    assert names(target.parent) == []


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, OSError])
def test_atomic_write_error_leaves_existing_file(target, error):
    target.write_text("old")
    with pytest.raises((error, ExportError)):
        write(target, then=fail_with(error), overwrite=True)
    assert target.read_text() == "old"
    assert names(target.parent) == ["map.npz"]


def test_atomic_write_full_disk_is_export_error(target):
    full = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    with pytest.raises(ExportError, match=r"cannot write .*map\.npz: No space left on device"):
        write(target, then=fail_with(full))
    assert names(target.parent) == []


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this system")
def test_atomic_write_disk_full_during_write(target):
    with pytest.raises(ExportError, match="No space left on device"):
        write(target, then=lambda _: Path("/dev/full").write_text("more"))


def test_atomic_write_moves_sidecar(target):
    write(target, then=write_sidecar)
    assert names(target.parent) == ["map.json", "map.npz"]


def test_atomic_write_keeps_existing_sidecar(target):
    sidecar = target.with_suffix(".json")
    sidecar.write_text("mine")
    with pytest.raises(ExportError, match=r"map\.json exists"):
        write(target, then=write_sidecar)
    assert sidecar.read_text() == "mine"
    assert names(target.parent) == ["map.json"]


def test_atomic_write_replaces_sidecar_with_overwrite(target):
    sidecar = target.with_suffix(".json")
    sidecar.write_text("mine")
    write(target, then=write_sidecar, overwrite=True)
    assert sidecar.read_text() == "{}"


@pytest.mark.parametrize("overwrite", [False, True])
def test_atomic_write_rejects_folder(target, overwrite):
    target.mkdir()
    with pytest.raises(ExportError, match=r"cannot write .*map\.npz: it is a folder"):
        write(target, overwrite=overwrite)
    assert names(target.parent) == ["map.npz"]


@pytest.mark.parametrize("writer", [atomic_write, atomic_folder])
def test_atomic_write_creates_folders(target, writer):
    with pytest.raises(KeyboardInterrupt), writer(target / "new" / "map.npz"):
        raise KeyboardInterrupt
    assert names(target.parent) == []
    with writer(target / "new" / "map.npz"):
        pass
    assert names(target) == ["new"]


def test_atomic_write_rejects_file_as_folder(target):
    target.write_text("old")
    with pytest.raises(ExportError, match=r"cannot write .*: .*map\.npz is not a folder"):
        write(target / "new" / "map.npz")
    assert target.read_text() == "old"


@pytest.mark.parametrize("overwrite", [False, True])
def test_atomic_write_rejects_fifo(target, overwrite):
    os.mkfifo(target)
    with pytest.raises(ExportError, match="it exists and is not a regular file"):
        write(target, overwrite=overwrite)
    assert target.is_fifo()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this system")
def test_atomic_write_rejects_device(target):
    target.symlink_to("/dev/full")
    with pytest.raises(ExportError, match="it exists and is not a regular file"):
        write(target, overwrite=True)
    assert target.is_char_device()


def test_atomic_write_keeps_symlink(target):
    target.symlink_to("elsewhere.txt")
    write(target)
    assert target.is_symlink()
    assert not target.with_name("elsewhere.txt").is_symlink()
    with pytest.raises(ExportError, match="exists"):
        write(target)


def test_atomic_write_through_symlink_uses_its_name(target):
    target.symlink_to("blob")
    with atomic_write(target) as path:
        assert path.name == target.name
        path.write_text("new")
    assert target.with_name("blob").read_text() == "new"
    assert target.is_symlink()


def test_atomic_write_rejects_symlink_to_itself(target):
    target.symlink_to(target.name)
    with pytest.raises(ExportError, match="cannot write"):
        write(target)
    assert target.is_symlink()


def test_atomic_write_rejects_long_name(tmp_path):
    with pytest.raises(ExportError, match=r"cannot write .*: File name too long"):
        write(tmp_path / ("m" * 300))


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_atomic_write_rejects_read_only_folder(target):
    target.parent.chmod(0o500)
    with pytest.raises(ExportError, match=r"cannot write .*: Permission denied"):
        write(target)
    target.parent.chmod(0o700)


def test_atomic_write_respects_umask(target):
    before = os.umask(0o022)
    write(target)
    os.umask(before)
    assert target.stat().st_mode & 0o777 == 0o644


@pytest.fixture
def old_folder(tmp_path):
    folder = tmp_path / "robot"
    folder.mkdir()
    (folder / "old.txt").write_text("old")
    return folder


def write_folder(path, *, then=None):
    with atomic_folder(path) as folder:
        (folder / "new.txt").write_text("new")
        if then:
            then(folder)


def test_atomic_folder_creates_folder_at_the_end(tmp_path):
    target = tmp_path / "runs" / "robot"
    with atomic_folder(target) as folder:
        (folder / "meshes").mkdir()
        assert not target.exists()
    assert names(target) == ["meshes"]
    assert names(target.parent) == ["robot"]


def test_atomic_folder_replaces_folder(old_folder):
    write_folder(old_folder)
    assert names(old_folder) == ["new.txt"]
    assert names(old_folder.parent) == ["robot"]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, OSError])
def test_atomic_folder_error_keeps_old_folder(old_folder, error):
    with pytest.raises((error, ExportError)):
        write_folder(old_folder, then=fail_with(error))
    assert names(old_folder) == ["old.txt"]
    assert names(old_folder.parent) == ["robot"]


@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError])
def test_atomic_folder_interrupted_move_restores_folder(monkeypatch, old_folder, error):
    replace = Path.replace

    def move(path, target):
        if target == old_folder and path.name == "robot":  # the new folder; the old one is away
            raise error
        return replace(path, target)

    monkeypatch.setattr(Path, "replace", move)
    with pytest.raises((error, ExportError)):
        write_folder(old_folder)
    assert names(old_folder) == ["old.txt"]
    assert names(old_folder.parent) == ["robot"]


def test_atomic_folder_rejects_file(target):
    target.write_text("old")
    with pytest.raises(ExportError, match=r"cannot write .*map\.npz: "):
        write_folder(target)
    assert target.read_text() == "old"
    assert names(target.parent) == ["map.npz"]


def test_atomic_write_removes_folders_of_killed_processes(tmp_path):
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    foreign = tmp_path / ".terrainkit-otherhost-1-abc"
    foreign.mkdir()
    with temporary_folder(tmp_path) as own:
        stale = own.with_name(own.name.replace(f"-{os.getpid()}-", f"-{dead.pid}-"))
        stale.mkdir()
        (stale / "map.npz").write_text("half")
        with atomic_write(tmp_path / "a.txt") as path:
            path.write_text("whole")
        assert {each.name for each in tmp_path.iterdir()} == {"a.txt", foreign.name, own.name}
    assert not own.exists()
