import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.rule import get_rule
from terrainkit_robots.lint.runner import lint
from tests.small_robots import link, shape
from tests.terrainkit_robots.description.made_robots import write_all


@pytest.mark.parametrize(("folders", "is_fixed"), [("a/b/c", True), ("a/b/c/d", False)])
def test_path_leads_up_to_three_folders_above(tmp_path, folders, is_fixed):
    mesh = tmp_path / "box.stl"
    mesh.write_text("")
    part = link("a", shape(f'mesh filename="{mesh}"'))
    file = write_all(tmp_path / folders, {"robot.urdf": f'<robot name="r">{part}</robot>'})
    (finding,) = lint(Facts(load_robot(file)), [get_rule("MSH002")]).findings
    assert (finding.fix is not None) == is_fixed
