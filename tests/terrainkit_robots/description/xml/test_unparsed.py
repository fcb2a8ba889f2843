from pathlib import Path

import pytest

from terrainkit_robots.description.xml.unparsed import UnparsedNumbers
from tests.terrainkit_robots.description.made_robots import read

ROBOT = """<robot name="r">
<link name="a"><inertial><mass value="{}"/></inertial></link><gazebo reference="nobody"/></robot>"""


@pytest.mark.parametrize(("mass", "unparsed"), [("one", True), ("1", False)])
def test_numbers_that_could_not_be_parsed_are_known_by_name_and_place(mass, unparsed):
    robot = read(ROBOT.format(mass), Path("robot.urdf"))
    found = UnparsedNumbers(robot)
    assert found.has("a", "value") is found.has("a", "xyz", "value") is unparsed
    assert not found.has("a", "xyz")
    assert not found.has("b", "value")
    places = {each.code: found.at(each.source) for each in robot.problems}
    assert places == {"TRE010": False} | ({"XML006": True} if unparsed else {})
    assert not found.at(None)
