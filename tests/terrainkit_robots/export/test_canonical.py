from itertools import pairwise

import numpy as np
import pytest

from terrainkit_robots.analysis.bodies.kinematics import body_poses
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.description.xml.document import RobotFileError
from terrainkit_robots.export.canonical import to_canonical
from tests.robots import REAL_ROBOTS

MASS = '<inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>'


def facts(tmp_path, text):
    path = tmp_path / ("robot.xml" if "<mujoco" in text else "robot.urdf")
    path.write_text(text)
    return Facts(load_robot(path))


def mjcf(body, more=""):
    return f"""<mujoco model="r"><compiler angle="radian"/><worldbody>
      <body name="base">{MASS}<geom size="0.1" mass="0"/>{body}</body></worldbody>{more}</mujoco>"""


def link_poses(robot, positions):
    poses = body_poses(robot.bodies, positions)
    return {
        link.name: pose @ local
        for body, pose in zip(robot.bodies, poses, strict=True)
        for link, local in zip(body.links, body.poses, strict=True)
    }


@pytest.mark.parametrize("name", REAL_ROBOTS)
def test_canonical_robot_is_equivalent(name, robot_file):
    check_same(Facts(load_robot(robot_file(name))))


@pytest.mark.parametrize("name", ["quadruped", "biped"])
@pytest.mark.parametrize("suffix", [".urdf", ".xml"])
def test_canonical_bundled_robot_is_equivalent(name, suffix):
    check_same(Facts(load_robot(bundled.urdf_path(name).with_suffix(suffix))))


def check_same(source):
    form = to_canonical(source)
    made = Facts(form.model)
    assert made.total_mass == pytest.approx(source.total_mass)
    assert [leg.foot for leg in made.legs] == [leg.foot for leg in source.legs]
    assert [j.name for j in made.actuated] == [j.name for j in source.actuated]
    rng = np.random.default_rng(1)
    positions = {joint.name: float(rng.uniform(-1, 1)) for joint in source.joints}
    here, there = link_poses(made, positions), link_poses(source, positions)
    assert here.keys() == there.keys()
    for link, pose in here.items():
        np.testing.assert_allclose(pose, there[link], atol=1e-12)
    # Doing it again changes nothing: the form is one.
    again = to_canonical(made)
    assert again.changes == ()
    assert [j.name for j in again.model.joints] == [j.name for j in form.model.joints]


def test_reference_moves_to_origin(tmp_path):
    robot = facts(
        tmp_path,
        mjcf(
            f'<body name="leg" pos="0 0 -0.2">{MASS}'
            '<joint name="j" axis="0 2 0" pos="0 0 0.1" ref="0.5" range="-1 1"/></body>'
        ),
    )
    (joint,) = to_canonical(robot).model.joints
    assert joint.reference == 0
    np.testing.assert_allclose(joint.axis, [0, 1, 0])
    # At q = 0.5 the leg is where the file has it; at 0 it is turned back about (0, 0, -0.1).
    c, s = np.cos(-0.5), np.sin(-0.5)
    np.testing.assert_allclose(joint.origin[:3, 3], [-0.1 * s, 0, -0.1 - 0.1 * c], atol=1e-12)
    (body,) = [b for b in Facts(to_canonical(robot).model).bodies if b.joint is not None]
    at = body_poses(Facts(to_canonical(robot).model).bodies, {"j": 0.5})[body.index]
    np.testing.assert_allclose(at[:3, 3], [0, 0, -0.2], atol=1e-12)


def test_unsupported_joint_is_fixed(tmp_path):
    robot = facts(tmp_path, mjcf(f'<body name="ball">{MASS}<joint name="b" type="ball"/></body>'))
    form = to_canonical(robot)
    assert [joint.kind for joint in form.model.joints] == ["fixed"]
    assert any("b" in change and "ball" in change for change in form.changes)


def test_mjcf_effort_is_that_of_actuator(tmp_path):
    robot = facts(
        tmp_path,
        mjcf(
            f'<body name="leg">{MASS}<joint name="j" axis="0 1 0" range="-1 1"/></body>',
            '<actuator><motor joint="j" gear="2" ctrlrange="-10 10"/></actuator>',
        ),
    )
    form = to_canonical(robot)
    (joint,) = form.model.joints
    assert joint.limit.effort == 20
    assert [motor.joint for motor in form.model.actuators] == ["j"]


def test_other_trees_are_removed(tmp_path):
    text = mjcf(f'<body name="leg">{MASS}<joint name="j"/></body>').replace(
        "</worldbody>", f'<body name="crate">{MASS}<freejoint/></body></worldbody>'
    )
    form = to_canonical(facts(tmp_path, text))
    assert [link.name for link in form.model.links] == ["base", "leg"]
    assert any("crate" in change for change in form.changes)


@pytest.mark.parametrize(
    ("joint", "floating"),
    [
        ("<freejoint/>", True),
        ("", False),
    ],
)
def test_mjcf_defines_floating_base(tmp_path, joint, floating):
    text = mjcf(f'<body name="arm">{MASS}<joint name="j" range="-1 1"/></body>')
    robot = facts(tmp_path, text.replace('<body name="base">', f'<body name="base">{joint}'))
    assert to_canonical(robot).model.floating is floating


def test_arm_is_fixed_and_car_is_not(tmp_path):
    link = (
        '<link name="{}"><inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" '
        'ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )
    joint = (
        '<joint name="j" type="{}"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/>{}</joint>'
    )
    limit = '<limit lower="-1" upper="1" effort="5" velocity="5"/>'
    links = link.format("a") + link.format("b")
    arm = f'<robot name="r">{links}{joint.format("revolute", limit)}</robot>'
    car = f'<robot name="r">{links}{joint.format("continuous", "")}</robot>'
    assert to_canonical(facts(tmp_path, arm)).model.floating is False
    assert to_canonical(facts(tmp_path, car)).model.floating is True
    assert to_canonical(facts(tmp_path, arm), floating=True).model.floating is True


CHAIN = """<robot name="r">{}<joint name="a" type="{}"><parent link="base"/><child link="one"/>
  <axis xyz="0 0 1"/><limit lower="{}" upper="{}" effort="5" velocity="5"/></joint>{}</robot>"""


@pytest.mark.parametrize(
    ("kind", "ends", "joints", "floating"),
    [
        ("revolute", (-1e16, 1e16), 1, True),  # a propeller, as exporters write it
        ("continuous", (0, 0), 1, True),
        ("revolute", (-1, 1), 2, True),  # a wheel that is steered
        ("revolute", (-1, 1), 3, False),  # the wrist of an arm
        ("prismatic", (-1e16, 1e16), 1, False),
    ],
)
def test_wheel_on_base_or_steering_body(tmp_path, kind, ends, joints, floating):
    names = ["base", "one", "two", "three"][: joints + 1]
    links = "".join(
        f'<link name="{name}"><inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" '
        'ixy="0" ixz="0" iyz="0"/></inertial></link>'
        for name in names
    )
    more = [
        f'<joint name="{name}" type="continuous"><parent link="{above}"/><child link="{name}"/>'
        '<origin xyz="0.1 0 0"/><axis xyz="0 1 0"/></joint>'
        for above, name in pairwise(names[1:])
    ]
    robot = facts(tmp_path, CHAIN.format(links, kind, *ends, "".join(more)))
    assert to_canonical(robot).model.floating is floating


def test_mass_from_mesh_matches_mujoco(tmp_path):
    import trimesh

    trimesh.creation.box((0.1, 0.2, 0.3)).export(tmp_path / "box.stl")
    text = """<mujoco><asset><mesh name="box" file="box.stl"/></asset><worldbody>
      <body name="base"><geom type="mesh" mesh="box" density="1000"/></body>
    </worldbody></mujoco>"""
    robot = facts(tmp_path, text)
    assert np.isnan(robot.total_mass)
    (link,) = to_canonical(robot).model.links
    assert link.inertial.mass == pytest.approx(6.0, rel=1e-5)
    moments = 6.0 / 12 * np.array([0.01 + 0.04, 0.01 + 0.09, 0.04 + 0.09])
    assert sorted(np.linalg.eigvalsh(link.inertial.inertia)) == pytest.approx(moments, rel=1e-4)


def test_robot_without_links_is_rejected(tmp_path):
    with pytest.raises(RobotFileError, match="expected a robot"):
        to_canonical(facts(tmp_path, '<robot name="r"/>'))


def test_duplicate_joint_names(tmp_path):
    text = """<robot name="r"><link name="a"/><link name="b"/><link name="c"/>
      <joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint>
      <joint name="j" type="fixed"><parent link="a"/><child link="c"/></joint></robot>"""
    form = to_canonical(facts(tmp_path, text))
    assert [joint.name for joint in form.model.joints] == ["j", "c_joint"]
    assert form.changes == ("renamed the joint of c to c_joint: duplicate name j",)


@pytest.mark.parametrize(("name", "wanted"), [("my robot/../x", "my_robot_.._x"), ("..", "robot")])
def test_plain_name(tmp_path, name, wanted):
    form = to_canonical(facts(tmp_path, f'<robot name="{name}"><link name="a"/></robot>'))
    assert form.model.name == wanted


def test_link_named_world_is_renamed(tmp_path):
    text = """<robot name="r"><link name="world"/><link name="world_link"/>
      <joint name="j" type="fixed"><parent link="world"/><child link="world_link"/></joint>
      </robot>"""
    form = to_canonical(facts(tmp_path, text))
    assert [link.name for link in form.model.links] == ["world_link_2", "world_link"]
    assert form.model.joints[0].parent == "world_link_2"
    assert form.model.floating is False
    assert form.changes == ("renamed link world to world_link_2: MuJoCo reserves the name world",)


DYNAMICS = """<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="continuous">
  <parent link="a"/><child link="b"/><dynamics damping="{0}" friction="{0}"/></joint></robot>"""


@pytest.mark.parametrize(("written", "wanted"), [("0.3", 0.3), ("-0.3", 0.0), ("nan", 0.0)])
def test_friction_and_damping(tmp_path, written, wanted):
    (joint,) = to_canonical(facts(tmp_path, DYNAMICS.format(written))).model.joints
    assert (joint.friction, joint.damping) == (wanted, wanted)


@pytest.mark.parametrize(
    ("leads", "changes"),
    [
        (("k", "j"), ("j", "k")),
        (("j", "j"), ("j",)),
        (("nobody", "j"), ("j",)),
    ],
)
def test_invalid_mimic_is_removed(tmp_path, leads, changes):
    joint = """<joint name="{}" type="continuous"><parent link="a"/><child link="{}"/>
      <mimic joint="{}"/></joint>"""
    joints = joint.format("j", "b", leads[0]) + joint.format("k", "c", leads[1])
    text = f'<robot name="r"><link name="a"/><link name="b"/><link name="c"/>{joints}</robot>'
    form = to_canonical(facts(tmp_path, text))
    free = [joint.name for joint in form.model.joints if joint.mimic is None]
    assert free == list(changes)
    why = {"nobody": "there is no joint 'nobody'"}.get(leads[0], "it is part of a cycle")
    assert form.changes == tuple(f"removed the mimic of {name}: {why}" for name in changes)


MESH = '<mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/>'


def test_endless_texture_is_not_read(tmp_path):
    """It would take 2.4 GB, for a mass."""
    text = f"""<mujoco><asset>{MESH}
      <texture name="t" type="2d" builtin="flat" width="20000" height="20000"/>
      <material name="p" texture="t"/></asset>
      <worldbody><body name="base"><geom type="mesh" mesh="m" material="p"/></body></worldbody>
    </mujoco>"""
    (link,) = to_canonical(facts(tmp_path, text)).model.links
    assert link.inertial.mass == pytest.approx(1000 / 6)


def test_unnamed_body_with_mesh_mass(tmp_path):
    text = f"""<mujoco><asset>{MESH}</asset><worldbody><body>
      <geom type="mesh" mesh="m"/></body></worldbody></mujoco>"""
    with pytest.raises(RobotFileError, match="a body with its mass from a mesh has no name"):
        to_canonical(facts(tmp_path, text))


def test_missing_mesh_for_mass(tmp_path):
    text = """<mujoco><asset><mesh name="m" file="no.stl"/></asset><worldbody><body name="base">
      <geom type="mesh" mesh="m"/></body></worldbody></mujoco>"""
    with pytest.raises(RobotFileError, match="cannot compute masses from meshes: MuJoCo rejects"):
        to_canonical(facts(tmp_path, text))
