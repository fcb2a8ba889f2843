import pytest

from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.export.unsupported import unsupported_elements

MJCF = """<mujoco>{rest}<worldbody><body name="a"><geom size="0.1"/>
  <body><joint name="j"/><geom size="0.1"/></body></body></worldbody>
  <tendon><fixed name="t"><joint joint="j" coef="1"/></fixed></tendon></mujoco>"""
PULL = '<actuator><motor name="pull" tendon="t"/></actuator>'
CUSTOM = '<custom><numeric name="n" data="1"/></custom>'


def read(rest, folder):
    path = folder / "robot.xml"
    path.write_text(MJCF.format(rest=rest))
    robot = load_robot(path)
    assert robot.problems == ()
    return robot


@pytest.mark.parametrize(
    ("rest", "told"), [("", []), (PULL, ["ignored 1 actuator without a joint: pull"])]
)
def test_unsupported_elements_are_counted(rest, told, tmp_path):
    lacking = "robot.urdf lacks 1 tendon of robot.xml, which URDF cannot have"
    assert list(unsupported_elements(read(rest, tmp_path))) == [lacking, *told]


def test_elements_of_unread_sections_are_counted(tmp_path):
    assert read(CUSTOM, tmp_path).left_out == ("1 element of <custom>",)


def test_urdf_has_no_unsupported_elements():
    assert not list(unsupported_elements(load_robot(bundled.urdf_path("quadruped"))))
