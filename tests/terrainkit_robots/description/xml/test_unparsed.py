from pathlib import Path

from terrainkit_robots.description.load import load_robot
from terrainkit_robots.description.xml.unparsed import UnparsedNumbers

FILE = Path("/robots/robot.urdf")
ROBOT = """<robot name="r">
<link name="a"><inertial><mass value="{mass}"/></inertial></link>
<link name="b"/>
<gazebo reference="nobody"/>
</robot>"""


def unparsed(text, file=FILE):
    robot = load_robot(file, contents={file: text.encode()})
    return robot, UnparsedNumbers(robot)


def test_numbers_that_could_not_be_parsed_are_known_by_name_and_place():
    robot, found = unparsed(ROBOT.format(mass="one"))
    (number,) = [each for each in robot.problems if each.code == "XML006"]
    others = [each.source for each in robot.problems if each.code != "XML006"]
    assert (number.subject, number.source.line) == ("a", 2)
    assert found.has("a", "value")
    assert found.has("a", "xyz", "value")
    assert not found.has("a", "xyz")
    assert not found.has("b", "value")
    assert found.at(number.source)
    assert others
    assert not any(map(found.at, others))
    assert not found.at(None)


def test_all_numbers_of_valid_files_are_parsed():
    robot, found = unparsed(ROBOT.format(mass="1"))
    assert not found.has("a", "value")
    assert not found.at(robot.links[0].source)
