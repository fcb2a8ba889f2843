import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import psutil
import pytest

from terrainkit import TerrainkitError
from terrainkit.errors import MemoryLimitError
from terrainkit.files import memory
from terrainkit.files.memory import check_memory, free_memory


@pytest.mark.parametrize("needed", [2 * psutil.virtual_memory().total, 1 << 62, 10**40])
def test_check_memory_rejects_large_work(needed):
    message = r"^a lot needs [\d.]+ GB of memory; [\d.]+ GB free$"
    with pytest.raises(MemoryLimitError, match=message) as error:
        check_memory(needed, "a lot")
    assert isinstance(error.value, MemoryError)
    assert isinstance(error.value, TerrainkitError)


def test_check_memory_accepts_what_is_free_and_names_parts_that_fit(monkeypatch):
    monkeypatch.setattr(memory, "free_memory", lambda: 10**9)
    check_memory(10**9, "training")
    for parts, hint in ((100, "; num_envs 25 would fit"), (4, "; num_envs 1 would fit"), (3, "")):
        with pytest.raises(MemoryLimitError) as error:
            check_memory(4 * 10**9, "training", ("num_envs", parts))
        assert str(error.value) == f"training needs 4.00 GB of memory; 1.00 GB free{hint}"


def test_check_memory_accepts_small_work(monkeypatch):
    monkeypatch.setattr(memory, "free_memory", lambda: 0)
    check_memory(1 << 24, "this test")
    with pytest.raises(MemoryLimitError):
        check_memory((1 << 24) + 1, "this test")


GB = 10**9


MOUNTS = {
    2: "29 23 0:26 / {} rw - cgroup2 cgroup2 rw,nsdelegate",
    1: "14 35 0:32 / {} rw,relatime - cgroup cgroup rw,memory",
    "container": "14 35 0:32 /docker/5f {} rw,relatime - cgroup cgroup rw,hugetlb,memory",
}
OTHER_MOUNTS = "23 1 8:1 / / rw - ext4 /dev/sda rw\n24 35 0:3 / {} rw - cgroup cgroup rw,cpu\n"


def make_process(folder, kind):
    """Make a stand-in for /proc/self, of a process in the control group job/step of folder/groups.

    Args:
        folder: Where to make it.
        kind: Version of the control groups; "container" for version 1, whose mount shows only the
            group of the container.
    """
    (folder / "groups").mkdir()
    mounts = OTHER_MOUNTS + MOUNTS[kind]
    (folder / "mountinfo").write_text(mounts.format(folder / "cpu", folder / "groups"))
    path = "/docker/5f/job/step" if kind == "container" else "/job/step"
    own = f"0::{path}" if kind == 2 else f"5:hugetlb,memory:{path}\n0::/"
    (folder / "cgroup").write_text(f"6:cpu:/other\n{own}\n")


def make_group(folder, kind, limit, cached=0):
    """Make a control group in which 2 GB are used."""
    folder.mkdir(parents=True, exist_ok=True)
    names = ["max", "current"] if kind == 2 else ["limit_in_bytes", "usage_in_bytes"]
    for name, value in zip(names, (limit, 2 * GB), strict=True):
        (folder / f"memory.{name}").write_text(f"{value}\n")
    stat = f"inactive_file {cached}\n" if kind == 2 else f"total_inactive_file {cached}\n"
    (folder / "memory.stat").write_text(f"anon 5\n{stat}")


@pytest.mark.parametrize("kind", MOUNTS)
@pytest.mark.parametrize(
    ("groups", "cached", "free"),
    [
        ({".": 3 * GB}, 0, GB),
        ({"job": 3 * GB}, 0, GB),
        ({"job/step": 3 * GB}, 0, GB),
        ({".": 9 * GB, "job": 3 * GB, "job/step": 8 * GB}, 0, GB),
        ({"job": 2 * GB}, 2 * GB, 2 * GB),  # the kernel reclaims the page cache
        ({"job": GB}, 0, 0),  # the limit was lowered
        ({"job": "max"}, 0, None),
        ({"job": (1 << 63) - 4096}, 0, None),  # version 1 without a limit
        ({"job": ""}, 0, None),
        ({"other": 1}, 0, None),
    ],
)
def test_free_memory_respects_control_groups(tmp_path, monkeypatch, kind, groups, cached, free):
    monkeypatch.setattr(memory, "PROCESS", tmp_path)
    monkeypatch.setattr(psutil, "virtual_memory", lambda: SimpleNamespace(available=7 * GB))
    make_process(tmp_path, kind)
    for name, limit in groups.items():
        make_group(tmp_path / "groups" / name, kind, limit, cached)
    assert free_memory() == (7 * GB if free is None else free)


def test_free_memory_of_a_process_outside_of_the_mount_is_that_of_its_root(tmp_path, monkeypatch):
    monkeypatch.setattr(memory, "PROCESS", tmp_path)
    make_process(tmp_path, "container")
    (tmp_path / "cgroup").write_text("5:memory:/docker/another\n")
    make_group(tmp_path / "groups", "container", 2 * GB + 9)
    assert free_memory() == 9


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="Linux only")
@pytest.mark.parametrize("kind", MOUNTS)
def test_limit_allocations_raises_where_the_kernel_would_kill(tmp_path, kind):
    make_process(tmp_path, kind)
    make_group(tmp_path / "groups" / "job", kind, 2 * GB + 3 * 10**8)
    code = f"""
from pathlib import Path
import numpy as np
from terrainkit.files import memory
memory.PROCESS = Path({str(tmp_path)!r})
(memory.PROCESS / "statm").write_text(Path("/proc/self/statm").read_text())
memory.limit_allocations(0)
np.ones(10**8, dtype=np.int8)
try:
    np.ones(4 * 10**8, dtype=np.int8)
except MemoryError:
    print("ends with an error")
"""
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert (run.stdout, run.stderr) == ("ends with an error\n", "")
