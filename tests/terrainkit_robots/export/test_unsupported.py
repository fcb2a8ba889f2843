import pytest

from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.export.unsupported import unsupported_elements
from tests.tables import read_table

MJCF = """<mujoco>{rest}<worldbody><body name="a"><geom size="0.1" {geom}/>
  <body><joint name="j" {joint}/><joint name="k" stiffness="0 0.0"/><geom size="0.1"/></body></body>
  </worldbody><tendon>{tendons}</tendon></mujoco>"""
PULL = '<actuator><motor name="pull" tendon="t"/></actuator>'
TENDON = '<fixed name="{}"><joint joint="j" coef="1"/></fixed>'


@pytest.mark.parametrize(
    ("parts", "told"),
    [
        *read_table(__file__, "unsupported_elements_are_counted"),
        ({"tendons": TENDON.format("t")}, "<tendon> (1 element)"),
        (
            {"tendons": TENDON.format("t") + TENDON.format("u"), "rest": PULL},
            "<tendon> (2 elements); 1 actuator without a joint: pull",
        ),
    ],
)
def test_unsupported_elements_are_counted(parts, told, tmp_path):
    path = tmp_path / "robot.xml"
    texts = dict.fromkeys(("rest", "geom", "joint", "tendons"), "") | parts
    path.write_text(MJCF.format(**texts))
    robot = load_robot(path)
    assert robot.problems == ()
    ignored = [each.removeprefix("ignored ") for each in unsupported_elements(robot)]
    assert "; ".join(ignored) == told


def test_urdf_has_no_unsupported_elements():
    assert unsupported_elements(load_robot(bundled.urdf_path("quadruped"))) == ()
