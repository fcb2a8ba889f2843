import psutil
import pytest

from terrainkit import MapConfig, TerrainkitError, generate
from terrainkit.errors import MemoryLimitError
from terrainkit.memory import check_memory


@pytest.mark.parametrize("needed", [0, 1 << 20, 1 << 28, (1 << 28) + 1])
def test_work_that_fits_is_let_through(needed):
    check_memory(needed, "this test")


@pytest.mark.parametrize("needed", [2 * psutil.virtual_memory().total, 1 << 62, 10**40])
def test_work_beyond_the_memory_is_refused_with_both_numbers(needed):
    with pytest.raises(
        MemoryLimitError, match=r"^a lot needs [\d.]+ GB of memory; [\d.]+ GB free$"
    ):
        check_memory(needed, "a lot")


def test_the_error_is_one_to_catch_as_memory_error_too():
    with pytest.raises(MemoryError) as error:
        check_memory(1 << 62, "a lot")
    assert isinstance(error.value, TerrainkitError)


def test_a_map_beyond_the_memory_is_refused_before_it_is_begun():
    with pytest.raises(MemoryLimitError, match=r"a map of \d+ x \d+ samples needs .* GB of memory"):
        generate(MapConfig(rows=10_000, cols=10_000))


@pytest.fixture
def group(tmp_path, monkeypatch):
    """Return a function that makes a control group which this process is in, or is below."""
    own = tmp_path / "cgroup"
    own.write_text("1:net:/x\n0::/job/step\n")
    monkeypatch.setattr("terrainkit.memory._OWN_GROUP", own)
    monkeypatch.setattr("terrainkit.memory._CONTROL_GROUPS", tmp_path / "groups")

    def make(name, limit, used=2 * 10**9, cached=0):
        folder = tmp_path / "groups" / name
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "memory.max").write_text(f"{limit}\n")
        (folder / "memory.current").write_text(f"{used}\n")
        (folder / "memory.stat").write_text(f"anon 5\ninactive_file {cached}\n")

    return make


@pytest.mark.parametrize("name", [".", "job", "job/step"])
def test_the_limit_of_a_control_group_counts(group, name):
    group("job/step", "max")
    group(name, 3 * 10**9)
    check_memory(9 * 10**8, "a map")
    with pytest.raises(MemoryLimitError, match=r"a map needs 1\.1 GB of memory; 1\.0 GB free"):
        check_memory(11 * 10**8, "a map")


def test_the_smallest_of_several_counts(group):
    group(".", 9 * 10**9)
    group("job", 3 * 10**9)
    group("job/step", 8 * 10**9)
    with pytest.raises(MemoryLimitError, match=r"1\.0 GB free"):
        check_memory(11 * 10**8, "a map")


def test_copies_of_files_are_no_use_of_memory(group):
    group("job", 3 * 10**9, used=28 * 10**8, cached=2 * 10**9)
    check_memory(21 * 10**8, "a map")
    with pytest.raises(MemoryLimitError, match=r"2\.2 GB free"):
        check_memory(23 * 10**8, "a map")


@pytest.mark.parametrize("limit", ["max", ""])
def test_a_control_group_without_a_limit_does_not(group, limit):
    group("job", limit, used=1)
    check_memory(3 * 10**8, "a map")


def test_a_limit_of_another_group_does_not(group):
    group("other", 1)
    check_memory(3 * 10**8, "a map")
