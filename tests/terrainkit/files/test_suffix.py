from pathlib import Path

import pytest

from terrainkit.errors import ExportError
from terrainkit.files.suffix import find_module, modules_by_suffix


def test_find_module_ignores_the_case_of_the_suffix():
    found = find_module(Path("map.OBJ"), "terrainkit.export", "format", ExportError)
    assert found.__name__ == "terrainkit.export.mesh_file"
    assert found is modules_by_suffix("terrainkit.export")[".glb"]


@pytest.mark.parametrize(
    ("name", "shown"), [("map.doc", "'.doc'"), ("map", "a name without suffix")]
)
def test_find_module_lists_the_suffixes(name, shown):
    with pytest.raises(ExportError) as error:
        find_module(Path(name), "terrainkit.export", "format", ExportError)
    assert str(error.value).startswith(f"no format for {shown} ({name}); there are: ")
    assert ".npz, " in str(error.value)
