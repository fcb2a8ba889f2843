import psutil
import pytest

from terrainkit import TerrainkitError
from terrainkit.errors import MemoryLimitError
from terrainkit.files import memory
from terrainkit.files.memory import check_memory


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
        assert str(error.value) == f"training needs 4.0 GB of memory; 1.0 GB free{hint}"


def test_check_memory_accepts_small_work(monkeypatch):
    monkeypatch.setattr(memory, "free_memory", lambda: 0)
    check_memory(1 << 28, "this test")
    with pytest.raises(MemoryLimitError):
        check_memory((1 << 28) + 1, "this test")


GB = 10**9


@pytest.mark.parametrize(
    ("groups", "cached", "free"),
    [
        ({".": 3 * GB}, 0, GB),
        ({"job": 3 * GB}, 0, GB),
        ({"job/step": 3 * GB}, 0, GB),
        ({".": 9 * GB, "job": 3 * GB, "job/step": 8 * GB}, 0, GB),
        ({"job": 2 * GB}, 2 * GB, 2 * GB),  # the kernel reclaims the page cache
        ({"job": "max"}, 0, None),
        ({"job": ""}, 0, None),
        ({"other": 1}, 0, None),
    ],
)
def test_check_memory_respects_control_groups(tmp_path, monkeypatch, groups, cached, free):
    monkeypatch.setattr(memory, "_OWN_GROUP", tmp_path / "cgroup")
    monkeypatch.setattr(memory, "_CONTROL_GROUPS", tmp_path / "groups")
    (tmp_path / "cgroup").write_text("1:net:/x\n0::/job/step\n")
    for name, limit in groups.items():
        folder = tmp_path / "groups" / name
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "memory.max").write_text(f"{limit}\n")
        (folder / "memory.current").write_text(f"{2 * GB}\n")
        (folder / "memory.stat").write_text(f"anon 5\ninactive_file {cached}\n")
    if free is None:
        check_memory(3 * 10**8, "a map")
    else:
        check_memory(free, "a map")
        with pytest.raises(MemoryLimitError, match=rf" {free / GB:.1f} GB free$"):
            check_memory(free + 1, "a map")
