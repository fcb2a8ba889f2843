from pathlib import Path

import pytest

from tests.tables import read_table
from tests.terrainkit_robots.description.made_robots import read


@pytest.mark.parametrize(
    ("name", "text", "kind", "codes"), read_table(__file__, "kind_is_that_of_root_or_file")
)
def test_kind_is_that_of_root_or_file(name, text, kind, codes):
    model = read(text, Path(name))
    assert (model.kind, [problem.code for problem in model.problems]) == (kind, codes)
    assert (model.links, model.file, model.sources) == ((), Path(name), (Path(name),))
    for problem in model.problems:
        if problem.code == "XML002":
            assert problem.message == (
                "format: got SDF with the root element <sdf>; expected URDF (<robot>), xacro or "
                "MJCF (<mujoco>)"
            )
