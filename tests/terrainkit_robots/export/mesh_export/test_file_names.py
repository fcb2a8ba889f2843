import pytest

from terrainkit_robots.export.mesh_export.file_names import FileNames
from tests.tables import read_table


def test_equal_content_shares_file():
    names = FileNames("meshes")
    assert names.add("hip", ".stl", b"1") == "meshes/hip.stl"
    assert names.add("thigh", ".stl", b"1") == "meshes/hip.stl"
    assert names.files == {"meshes/hip.stl": b"1"}


def test_names_are_unique_without_suffix_and_case():
    names = FileNames("m")
    wanted = [("hip", ".stl"), ("HIP", ".stl"), ("hip", ".obj"), ("hip_2", ".stl")]
    added = [names.add(stem, suffix, bytes([k])) for k, (stem, suffix) in enumerate(wanted)]
    assert added == ["m/hip.stl", "m/HIP_2.stl", "m/hip_3.obj", "m/hip_2_2.stl"]


@pytest.mark.parametrize(
    ("wanted", "name"),
    [
        *read_table(__file__, "names_are_valid"),
        ("x" * 500, f"m/{'x' * 80}.stl"),
    ],
)
def test_names_are_valid(wanted, name):
    assert FileNames("m").add(wanted, ".stl", b"") == name
