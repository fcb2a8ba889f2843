import psutil
import pytest

from terrainkit import MapConfig, TerrainkitError, generate
from terrainkit.errors import MemoryLimitError
from terrainkit.files.memory import check_memory


@pytest.mark.parametrize("needed", [0, 1 << 20, 1 << 28, (1 << 28) + 1])
def test_check_memory_accepts_small_work(needed):
    check_memory(needed, "this test")


@pytest.mark.parametrize("needed", [2 * psutil.virtual_memory().total, 1 << 62, 10**40])
def test_check_memory_rejects_large_work(needed):
    with pytest.raises(
        MemoryLimitError, match=r"^a lot needs [\d.]+ GB of memory; [\d.]+ GB free$"
    ):
        check_memory(needed, "a lot")


def test_check_memory_names_parts_that_fit(monkeypatch):
    monkeypatch.setattr("terrainkit.files.memory._free_memory", lambda: 10**9)
    with pytest.raises(MemoryLimitError, match=r"; num_envs 25 would fit$"):
        check_memory(4 * 10**9, "training", ("num_envs", 100))
    with pytest.raises(MemoryLimitError, match=r"1\.0 GB free$"):
        check_memory(4 * 10**9, "training", ("num_envs", 1))


def test_check_memory_error_is_a_memory_error():
    with pytest.raises(MemoryError) as error:
        check_memory(1 << 62, "a lot")
    assert isinstance(error.value, TerrainkitError)


def test_check_memory_rejects_large_map():
    with pytest.raises(MemoryLimitError, match=r"a map of \d+ x \d+ samples needs .* GB of memory"):
        generate(MapConfig(rows=10_000, cols=10_000))


@pytest.fixture
def group(tmp_path, monkeypatch):
    """Return a function that makes a control group which this process is in, or is below."""
    own = tmp_path / "cgroup"
    own.write_text("1:net:/x\n0::/job/step\n")
    monkeypatch.setattr("terrainkit.files.memory._OWN_GROUP", own)
    monkeypatch.setattr("terrainkit.files.memory._CONTROL_GROUPS", tmp_path / "groups")

    def make(name, limit, used=2 * 10**9, cached=0):
        folder = tmp_path / "groups" / name
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "memory.max").write_text(f"{limit}\n")
        (folder / "memory.current").write_text(f"{used}\n")
        (folder / "memory.stat").write_text(f"anon 5\ninactive_file {cached}\n")

    return make


@pytest.mark.parametrize("name", [".", "job", "job/step"])
def test_check_memory_respects_control_group(group, name):
    group("job/step", "max")
    group(name, 3 * 10**9)
    check_memory(9 * 10**8, "a map")
    with pytest.raises(MemoryLimitError, match=r"a map needs 1\.1 GB of memory; 1\.0 GB free"):
        check_memory(11 * 10**8, "a map")


def test_check_memory_uses_smallest_limit(group):
    group(".", 9 * 10**9)
    group("job", 3 * 10**9)
    group("job/step", 8 * 10**9)
    with pytest.raises(MemoryLimitError, match=r"1\.0 GB free"):
        check_memory(11 * 10**8, "a map")


def test_check_memory_ignores_page_cache(group):
    group("job", 3 * 10**9, used=28 * 10**8, cached=2 * 10**9)
    check_memory(21 * 10**8, "a map")
    with pytest.raises(MemoryLimitError, match=r"2\.2 GB free"):
        check_memory(23 * 10**8, "a map")


@pytest.mark.parametrize("limit", ["max", ""])
def test_check_memory_ignores_group_without_limit(group, limit):
    group("job", limit, used=1)
    check_memory(3 * 10**8, "a map")


def test_check_memory_ignores_other_groups(group):
    group("other", 1)
    check_memory(3 * 10**8, "a map")
