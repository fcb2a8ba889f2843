import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.export.base_link import with_world_base
from terrainkit_robots.onboarding.pipeline import OnboardOptions, onboard
from terrainkit_robots.spec.robot_spec import RobotSpec

MASS = '<inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/><geom size="0.1" mass="0"/>'
CART = f"""<mujoco model="cart"><worldbody>
  <body name="cart" pos="0 0 1">{MASS}<joint name="slider" type="slide" range="-1 1"/>
    <body name="pole">{MASS}<joint name="hinge" axis="0 1 0" pos="0 0 -0.3"/></body></body>
  <body name="table">{MASS}</body>
  <body name="ball">{MASS}<joint name="roll"/></body>
</worldbody><actuator><motor name="push" joint="slider" ctrlrange="-5 5"/></actuator></mujoco>"""
ARM = """<body name="{0}" pos="{1} 0 0">%s
  <body name="{0}_arm">%s<joint name="{0}_joint"/></body></body>"""
ARMS = f"""<mujoco model="arms"><worldbody>
  {(ARM % (MASS, MASS)).format("left", -1)}{(ARM % (MASS, MASS)).format("right", 1)}
</worldbody><actuator><motor joint="left_joint"/><motor joint="right_joint"/></actuator></mujoco>"""
WALKER = f"""<mujoco model="walker"><worldbody><body name="torso" pos="0 0 1">{MASS}
  <joint name="z" type="slide" axis="0 0 1"/><joint name="x" type="slide" axis="1 0 0"/>
  <joint name="turn" axis="0 1 0"/>
  <body name="arm" pos="0.5 0 0">{MASS}<joint name="elbow" axis="0 1 0" range="-60 60"/></body>
</body></worldbody><actuator><motor joint="elbow" ctrlrange="-5 5"/></actuator></mujoco>"""


def facts(tmp_path, text):
    path = tmp_path / "robot.xml"
    path.write_text(text)
    return Facts(load_robot(path))


def onboard_text(tmp_path, text, **options):
    robot = facts(tmp_path, text)
    folder = tmp_path / "robot"
    done = onboard(robot.model.file, folder, OnboardOptions(render_images=False, **options))
    return done, RobotSpec.load(folder / "robot.toml")


def test_cart_on_rail(tmp_path):
    done, spec = onboard_text(tmp_path, CART)
    assert [joint.name for joint in done.robot.facts.joints] == ["slider", "hinge"]
    assert (spec.joint_order, spec.floating, spec.base) == (("slider",), False, "cart")
    assert done.robot.changes == (
        "removed table, ball: not part of the kinematic tree",
        "added the base link world_link for the world, with joints slider",
    )


def test_two_arms(tmp_path):
    done, spec = onboard_text(tmp_path, ARMS)
    assert spec.joint_order == ("left_joint", "right_joint")
    assert len(done.robot.facts.links) == 4


@pytest.mark.parametrize("floating", [None, True])
def test_planar_walker(tmp_path, floating):
    done, spec = onboard_text(tmp_path, WALKER, floating=floating)
    moving = [joint.name for joint in done.robot.facts.joints]
    assert moving == (["elbow"] if floating else ["z", "x", "turn", "elbow"])
    assert (spec.floating, spec.base) == (bool(floating), "torso")
    told = "removed z, x, turn: " if floating else "added the base link world_link "
    assert any(change.startswith(told) for change in done.robot.changes)


@pytest.mark.parametrize("joint", ["<freejoint/>", ""])
def test_robot_with_base_is_unchanged(tmp_path, joint):
    text = ARMS.split("</worldbody>")[0].replace(
        '<body name="left" pos="-1 0 0">', f'<body name="left" pos="-1 0 0">{joint}'
    )
    robot = facts(tmp_path, text + "</worldbody></mujoco>")
    assert with_world_base(robot) is robot
