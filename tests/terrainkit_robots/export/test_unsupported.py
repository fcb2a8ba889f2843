from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.export.unsupported import unsupported_elements

MJCF = """<mujoco><worldbody><body name="a"><geom size="0.1"/>
  <body name="b"><joint name="j" stiffness="5" frictionloss="0.5"/><geom size="0.1"/></body></body>
</worldbody>
<equality><joint joint1="j" polycoef="0.5 0 0 0 0"/></equality>
<tendon><fixed name="t"><joint joint="j" coef="1"/></fixed></tendon></mujoco>"""


def test_unsupported_sections_and_stiffness(tmp_path):
    path = tmp_path / "robot.xml"
    path.write_text(MJCF)
    assert unsupported_elements(load_robot(path)) == (
        "ignored <tendon> (1 element)",
        "ignored <equality> (1 element)",
        "ignored stiffness of joints (1 element)",
    )


def test_actuators_of_tendons(tmp_path):
    path = tmp_path / "robot.xml"
    more = '<actuator><motor name="pull" tendon="t"/></actuator></mujoco>'
    text = MJCF.replace("</mujoco>", more).replace('stiffness="5"', "")
    text = text.replace("</body></body>", '<joint name="k"/></body></body>', 1)
    path.write_text(text.replace('joint1="j"', 'joint1="j" joint2="k"'))
    model = load_robot(path)
    assert not model.problems
    assert unsupported_elements(model) == (
        "ignored <tendon> (1 element)",
        "ignored 1 actuator without a joint: pull",
    )


def test_urdf_has_no_unsupported_elements():
    assert unsupported_elements(load_robot(bundled.urdf_path("quadruped"))) == ()


def test_contact_parameters(tmp_path):
    path = tmp_path / "robot.xml"
    path.write_text(
        """<mujoco><default><geom condim="6"/></default><worldbody><body name="a">
        <geom size="0.1" friction="0.4 0.02 0.01" priority="1"/><geom size="0.1"/>
        </body></worldbody></mujoco>"""
    )
    assert unsupported_elements(load_robot(path)) == (
        "ignored friction and contact parameters of geoms (2 elements)",
    )
