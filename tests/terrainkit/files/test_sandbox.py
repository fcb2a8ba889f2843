"""A process that gave up its rights changes nothing; the calls run in child processes."""

import _thread
import os
import signal
import socket
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from terrainkit.files.child_process import ProcessError, run_in_process
from tests.child_functions import in_sandbox

pytestmark = [
    pytest.mark.usefixtures("real_child"),
    pytest.mark.skipif(sys.platform != "linux", reason="Linux only"),
]

CHANGES = {
    "create": partial(os.open, "new", os.O_RDONLY | os.O_CREAT),
    "write": partial(os.open, "file", os.O_WRONLY),
    "read and write": partial(os.open, "file", os.O_RDWR),
    "truncate on opening": partial(os.open, "file", os.O_RDONLY | os.O_TRUNC),
    "append": partial(os.open, "file", os.O_RDONLY | os.O_APPEND),
    "unnamed": partial(os.open, ".", os.O_TMPFILE | os.O_RDWR),
    "truncate": partial(os.truncate, "file", 0),
    "rename": partial(os.rename, "file", "new"),
    "replace": partial(os.replace, "file", "new"),
    "remove": partial(os.unlink, "file"),
    "link": partial(os.link, "file", "new"),
    "symbolic link": partial(os.symlink, "file", "new"),
    "folder": partial(os.mkdir, "new"),
    "remove a folder": partial(os.rmdir, "folder"),
    "pipe": partial(os.mkfifo, "new"),
    "mode": partial(os.chmod, "file", 0o777),
    "owner": partial(os.chown, "file", 1, 1),
    "times": partial(os.utime, "file", (0, 0)),
    "attribute": partial(os.setxattr, "file", "user.a", b"b"),
    "memory file": partial(os.memfd_create, "new"),
    "fork": os.fork,
    "start": partial(os.execv, "/bin/true", ["true"]),
    "spawn": partial(os.posix_spawn, "/bin/true", ["true"], {}),
    "shell": partial(subprocess.check_call, "true", shell=True),
    "kill": partial(os.kill, 1, 0),
    "connect": socket.socket,
    "pair": socket.socketpair,
    "thread": partial(_thread.start_new_thread, int, ()),
    "priority": partial(os.setpriority, os.PRIO_PROCESS, 0, 1),
    "user": partial(os.setuid, 1),
    "root": partial(os.chroot, "."),
    "signal": partial(signal.setitimer, signal.ITIMER_REAL, 1),
}


def status(file):
    found = file.stat()
    return found.st_mode, found.st_uid, found.st_nlink, found.st_mtime_ns


@pytest.mark.parametrize("name", CHANGES)
def test_sandbox_refuses(tmp_path, name):
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("content")
    os.utime(tmp_path / "file", (1, 1))
    before = os.listxattr(tmp_path / "file"), status(tmp_path / "file")
    change = CHANGES[name]
    with pytest.raises(ProcessError, match=r"Operation not permitted|can't start new thread"):
        run_in_process(in_sandbox, tmp_path, change)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "folder"]
    assert (tmp_path / "file").read_text() == "content"
    assert (os.listxattr(tmp_path / "file"), status(tmp_path / "file")) == before


def test_sandbox_reads_files_and_computes(tmp_path):
    (tmp_path / "file").write_text("content")
    read = run_in_process(in_sandbox, tmp_path, partial(Path.read_text, Path("file")))
    assert read["value"] == "content"
    product = run_in_process(in_sandbox, tmp_path, partial(np.dot, np.ones(9), np.ones(9)))
    assert product["value"] == 9
