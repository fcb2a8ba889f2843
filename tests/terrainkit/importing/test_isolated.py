import numpy as np
import pytest
import trimesh

from terrainkit.errors import HeightFileError
from terrainkit.importing import isolated
from terrainkit.importing.isolated import check_file, run_isolated

pytestmark = pytest.mark.usefixtures("real_child")


@pytest.fixture
def mesh(tmp_path):
    trimesh.creation.box().export(tmp_path / "a.stl")
    return tmp_path / "a.stl"


def test_isolated_returns_arrays(mesh):
    arrays = run_isolated("read_mesh", mesh, "stl")
    assert arrays["faces"].shape == (12, 3)
    assert np.abs(arrays["vertices"]).max() == 0.5


def test_isolated_has_time_limit(mesh, monkeypatch):
    monkeypatch.setattr(isolated, "MAX_SECONDS", 0.001)
    with pytest.raises(HeightFileError, match=r"a\.stl: cannot be read: takes more than 0\.001 s"):
        run_isolated("read_mesh", mesh, "stl")


def test_isolated_error_is_one_line(mesh):
    with pytest.raises(HeightFileError, match=r"^CoACD failed: ") as caught:
        run_isolated("convex_parts", mesh, "{}", subject="CoACD failed")
    assert "\n" not in str(caught.value)


def test_isolated_size_limit(mesh, monkeypatch):
    check_file(mesh)
    monkeypatch.setattr(isolated, "MAX_FILE_BYTES", 100)
    with pytest.raises(HeightFileError, match=r"got 684 bytes; expected at most 100"):
        check_file(mesh)


def test_check_file_rejects_empty_file(tmp_path):
    path = tmp_path / "a.glb"
    path.touch()
    with pytest.raises(HeightFileError, match=r"a\.glb: got an empty file$"):
        check_file(path)
