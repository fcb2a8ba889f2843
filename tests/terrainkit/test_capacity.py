import psutil
import pytest

from terrainkit import MapConfig, TerrainkitError, generate
from terrainkit.capacity import require_memory
from terrainkit.errors import CapacityError


@pytest.mark.parametrize("needed", [0, 1 << 20, 1 << 28, (1 << 28) + 1])
def test_work_that_fits_is_let_through(needed):
    require_memory(needed, "this test")


@pytest.mark.parametrize("needed", [2 * psutil.virtual_memory().total, 1 << 62, 10**40])
def test_work_beyond_the_memory_is_refused_with_both_numbers(needed):
    with pytest.raises(CapacityError, match=r"^a lot needs [\d.]+ GB of memory; [\d.]+ GB free$"):
        require_memory(needed, "a lot")


def test_the_error_is_one_to_catch_as_memory_error_too():
    with pytest.raises(MemoryError) as error:
        require_memory(1 << 62, "a lot")
    assert isinstance(error.value, TerrainkitError)


def test_a_map_beyond_the_memory_is_refused_before_it_is_begun():
    with pytest.raises(CapacityError, match=r"a map of \d+ x \d+ samples needs .* GB of memory"):
        generate(MapConfig(rows=10_000, cols=10_000))


def test_the_limit_of_a_control_group_counts(tmp_path, monkeypatch):
    (tmp_path / "memory.max").write_text(f"{3 * 10**9}\n")
    (tmp_path / "memory.current").write_text(f"{2 * 10**9}\n")
    monkeypatch.setattr("terrainkit.capacity._CONTROL_GROUP", str(tmp_path))
    require_memory(9 * 10**8, "a map")
    with pytest.raises(CapacityError, match=r"a map needs 1\.1 GB of memory; 1\.0 GB free"):
        require_memory(11 * 10**8, "a map")


@pytest.mark.parametrize("limit", ["max\n", ""])
def test_a_control_group_without_a_limit_does_not(tmp_path, monkeypatch, limit):
    (tmp_path / "memory.max").write_text(limit)
    (tmp_path / "memory.current").write_text("1\n")
    monkeypatch.setattr("terrainkit.capacity._CONTROL_GROUP", str(tmp_path))
    require_memory(3 * 10**8, "a map")
