import pytest

from terrainkit_robots.export.canonical import to_canonical
from tests.terrainkit_robots.export.made_models import MJCF_MASS

CART = f"""<mujoco model="cart"><worldbody>
  <body name="cart" pos="0 0 1">{MJCF_MASS}<joint name="slider" type="slide" range="-1 1"/>
    <body name="pole">{MJCF_MASS}<joint name="hinge" axis="0 1 0" pos="0 0 -0.3"/></body></body>
  <body name="table">{MJCF_MASS}</body>
  <body name="ball">{MJCF_MASS}<joint name="roll"/></body>
</worldbody><actuator><motor name="push" joint="slider" ctrlrange="-5 5"/></actuator></mujoco>"""
ARM = f"""<body name="{{0}}" pos="{{1}} 0 0">{MJCF_MASS}
  <body name="{{0}}_arm">{MJCF_MASS}<joint name="{{0}}_joint"/></body></body>"""
ARMS = f"""<mujoco model="arms"><worldbody>{ARM.format("left", -1)}{ARM.format("right", 1)}
</worldbody><actuator><motor joint="left_joint"/><motor joint="right_joint"/></actuator></mujoco>"""
WALKER = f"""<mujoco model="walker"><worldbody><body name="torso" pos="0 0 1">{MJCF_MASS}
  <joint name="z" type="slide" axis="0 0 1"/><joint name="x" type="slide" axis="1 0 0"/>
  <joint name="turn" axis="0 1 0"/>
  <body name="arm" pos="0.5 0 0">{MJCF_MASS}<joint name="elbow" range="-60 60"/></body>
</body></worldbody><actuator><motor joint="elbow" ctrlrange="-5 5"/></actuator></mujoco>"""
LOST = "removed table, ball: not part of the kinematic tree"
FREED = "removed z, x, turn: joints between the world and the robot"
ADDED = "added the base link world_link for the world, with joints"


@pytest.mark.parametrize(
    ("text", "floating", "joints", "changes"),
    [
        (CART, None, "slider hinge", (LOST, f"{ADDED} slider")),
        (ARMS, None, "left_joint right_joint", (f"{ADDED} left_fixed, right_fixed",)),
        (WALKER, None, "z x turn elbow", (f"{ADDED} z",)),
        (WALKER, True, "elbow", (FREED,)),
    ],
    ids=["cart", "arms", "walker", "free walker"],
)
def test_world_becomes_the_base(text, floating, joints, changes, robot):
    form = to_canonical(robot(text), floating=floating)
    assert " ".join(joint.name for joint in form.model.joints if joint.moves) == joints
    base = "torso" if floating else "world_link"
    assert (form.model.links[0].name, form.model.floating) == (base, bool(floating))
    assert form.changes == changes


@pytest.mark.parametrize(
    ("base", "motors"), [("<freejoint/>", 2), ('<joint type="ball"/>', 2), ("", 1)]
)
def test_robot_with_base_is_unchanged(base, motors, robot):
    """A fixed arm is a base if it alone has an actuator."""
    left, motor = '<body name="left" pos="-1 0 0">', '<motor joint="right_joint"/>'
    text = ARMS.replace(left, left + base).replace(motor, motor * (motors - 1))
    assert "world" not in robot(text).tree.links


def test_base_is_free_only_on_request(robot):
    facts = robot(WALKER)
    assert (facts.model.floating, facts.bodies[0].top.name) == (False, "world")
    free = facts.with_free_base()
    assert (free.model.floating, free.bodies[0].top.name) == (True, "torso")
    parents = {joint.name: joint.parent for joint in free.model.joints}
    assert parents == dict.fromkeys(("z", "x", "turn"), "world") | {"elbow": "torso"}
    assert free.with_free_base() is free


def test_legs_of_a_trunk_in_the_world(robot):
    leg = f"""<body name="{{0}}" pos="0 {{1}} 0"><joint name="{{0}}_hip" axis="0 1 0"/>
      <geom size="0.02" fromto="0 0 0 0 0 -0.3" type="capsule"/><body name="{{0}}_foot"
      pos="0 0 -0.3">{MJCF_MASS}<joint name="{{0}}_knee" axis="0 1 0"/>
      <geom size="0.02" pos="0 0 -0.3"/></body></body>"""
    motors = "".join(f'<motor joint="{n}_{j}"/>' for n in ("a", "b") for j in ("hip", "knee"))
    text = f"""<mujoco><worldbody><geom type="box" size="0.1 0.1 0.1"/>{leg.format("a", 0.2)}
      {leg.format("b", -0.2)}</worldbody><actuator>{motors}</actuator></mujoco>"""
    assert [leg.foot for leg in robot(text).legs] == ["a_foot", "b_foot"]
