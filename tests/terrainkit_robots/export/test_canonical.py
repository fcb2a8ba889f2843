import numpy as np
import pytest
import trimesh

from terrainkit_robots.analysis.bodies.kinematics import body_poses
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.description.xml.document import RobotFileError
from terrainkit_robots.export.canonical import has_unknown_inertia, to_canonical
from tests.robots import ROBOTS
from tests.terrainkit_robots.export.made_models import MJCF_MASS, inertial, urdf_link


def mjcf(body, more="", base=""):
    return f"""<mujoco model="r"><compiler angle="radian"/><worldbody><body name="base">{base}
      {MJCF_MASS}<geom size="0.1" mass="0"/>{body}</body></worldbody>{more}</mujoco>"""


def urdf(*joints, links="abc", name="r"):
    return f'<robot name="{name}">{"".join(map(urdf_link, links))}{"".join(joints)}</robot>'


def urdf_joint(name, parent, child, kind="continuous", inside=""):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<axis xyz="0 1 0"/>{inside}</joint>'
    )


def link_poses(facts, positions):
    return {
        link.name: pose @ local
        for body, pose in zip(facts.bodies, body_poses(facts.bodies, positions), strict=True)
        for link, local in zip(body.links, body.poses, strict=True)
    }


@pytest.mark.parametrize("name", ROBOTS)
def test_canonical_robot_is_equivalent(name, robot_file):
    source = Facts(load_robot(robot_file(name)))
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


def test_reference_moves_to_origin(robot):
    leg = f"""<body name="leg" pos="0 0 -0.2">{MJCF_MASS}
      <joint name="j" axis="0 2 0" pos="0 0 0.1" ref="0.5" range="-1 1"/></body>"""
    model = to_canonical(robot(mjcf(leg))).model
    (joint,) = model.joints
    assert (joint.reference, joint.axis.tolist()) == (0, [0, 1, 0])
    # At q = 0.5 the leg is where the file has it; at 0 it is turned back about (0, 0, -0.1).
    c, s = np.cos(-0.5), np.sin(-0.5)
    np.testing.assert_allclose(joint.origin[:3, 3], [-0.1 * s, 0, -0.1 - 0.1 * c], atol=1e-12)
    there = link_poses(Facts(model), {"j": 0.5})["leg"]
    np.testing.assert_allclose(there[:3, 3], [0, 0, -0.2], atol=1e-12)


@pytest.mark.parametrize(
    ("kind", "limit", "wanted", "changes"),
    [
        ("revolute", 'lower="-1" upper="2"', ("revolute", -1, 2), ()),
        ("revolute", 'lower="2" upper="1"', ("continuous", None, None), ("j has no limits",)),
        ("continuous", 'lower="-1" upper="2"', ("continuous", None, None), ()),
        ("prismatic", 'lower="-1" upper="2"', ("prismatic", -1, 2), ()),
        ("prismatic", "", ("prismatic", None, None), ()),
    ],
)
def test_kind_follows_limits(kind, limit, wanted, changes, robot):
    form = to_canonical(
        robot(urdf(urdf_joint("j", "a", "b", kind, f"<limit {limit}/>"), links="ab"))
    )
    (joint,) = form.model.joints
    assert (joint.kind, joint.limit.lower, joint.limit.upper) == wanted
    assert form.changes == changes


def test_ball_joint_becomes_three_hinges(robot):
    form = to_canonical(robot(mjcf(f'<body>{MJCF_MASS}<joint name="b" type="ball"/></body>')))
    assert [joint.name for joint in form.model.joints] == ["b_x", "b_y", "b_z"]
    assert [joint.axis.tolist() for joint in form.model.joints] == np.eye(3).tolist()
    assert form.changes == ("replaced each ball joint by three hinges",)


def test_mjcf_effort_is_that_of_actuator(robot):
    leg = f'<body>{MJCF_MASS}<joint name="j" range="-1 1"/><body><joint name="k"/></body></body>'
    drive = '<actuator><motor joint="j" gear="2" ctrlrange="-10 10"/></actuator>'
    model = to_canonical(robot(mjcf(leg, drive))).model
    assert [joint.limit.effort for joint in model.joints] == [20, None]
    assert [(motor.name, motor.joint, motor.effort) for motor in model.actuators] == [
        ("j", "j", 20)
    ]


@pytest.mark.parametrize(("written", "wanted"), [("0.3", 0.3), ("-0.3", 0.0), ("0", 0.0)])
def test_losses_and_limits_are_positive(written, wanted, robot):
    inside = '<dynamics damping="{0}" friction="{0}"/><limit effort="{0}" velocity="{0}"/>'
    text = urdf(urdf_joint("j", "a", "b", inside=inside.format(written)), links="ab")
    (joint,) = to_canonical(robot(text)).model.joints
    assert (joint.friction, joint.damping) == (wanted, wanted)
    assert (joint.effort, joint.velocity) == (wanted or None, wanted or None)


def test_duplicate_joint_names(robot):
    joints = [urdf_joint("j", "a", "b", "fixed"), urdf_joint("j", "a", "c", "fixed")]
    form = to_canonical(robot(urdf(*joints)))
    assert [joint.name for joint in form.model.joints] == ["j", "c_joint"]
    assert form.changes == ("renamed the joint of c to c_joint: duplicate name j",)


@pytest.mark.parametrize(
    ("leads", "removed", "why"),
    [
        (("k", "j"), ("j", "k"), "it is part of a cycle"),
        (("j", "j"), ("j",), "it is part of a cycle"),
        (("nobody", "j"), ("j",), "there is no joint 'nobody'"),
    ],
)
def test_invalid_mimic_is_removed(leads, removed, why, robot):
    joints = [
        urdf_joint(name, "a", child, inside=f'<mimic joint="{lead}"/>')
        for name, child, lead in zip("jk", "bc", leads, strict=True)
    ]
    form = to_canonical(robot(urdf(*joints)))
    assert tuple(joint.name for joint in form.model.joints if joint.mimic is None) == removed
    assert form.changes == tuple(f"removed the mimic of {name}: {why}" for name in removed)


@pytest.mark.parametrize(("base", "floating"), [("<freejoint/>", True), ("", False)])
def test_mjcf_defines_floating_base(base, floating, robot):
    text = mjcf(f'<body>{MJCF_MASS}<joint name="j" range="-1 1"/></body>', base=base)
    assert to_canonical(robot(text)).model.floating is floating


TURN = 4 * np.pi


@pytest.mark.parametrize(
    ("kind", "limit", "joints", "floating"),
    [
        ("revolute", 'lower="-1" upper="1"', 1, False),
        ("revolute", f'lower="0" upper="{TURN - 0.01}"', 1, False),
        ("revolute", f'lower="0" upper="{TURN + 0.01}"', 1, True),  # a propeller, as exported
        ("continuous", "", 1, True),
        ("revolute", 'lower="-1" upper="1"', 2, True),  # a wheel that is steered
        ("revolute", 'lower="-1" upper="1"', 3, False),  # the wrist of an arm
        ("prismatic", 'lower="-1e16" upper="1e16"', 1, False),
    ],
)
def test_wheel_on_base_or_steering_body(kind, limit, joints, floating, robot):
    first = urdf_joint("first", "a", "b", kind, f"<limit {limit}/>")
    others = [
        urdf_joint(child, parent, child, inside='<origin xyz="0.1 0 0"/>')
        for parent, child in [("b", "c"), ("c", "d")][: joints - 1]
    ]
    facts = robot(urdf(first, *others, links="abcd"[: joints + 1]))
    assert to_canonical(facts).model.floating is floating
    assert to_canonical(facts, floating=not floating).model.floating is not floating


def test_base_without_joints_is_free_if_it_has_a_mass(robot):
    assert to_canonical(robot(urdf(links="a"))).model.floating is True
    assert to_canonical(robot('<robot name="r"><link name="a"/></robot>')).model.floating is False


def test_robot_without_links_is_rejected(robot):
    with pytest.raises(RobotFileError, match="got no links; expected a robot"):
        to_canonical(robot('<robot name="r"/>'))


def test_other_trees_are_removed(robot):
    excluded = '<contact><exclude body1="base" body2="{}"/></contact>'
    crate = f'<body name="crate">{MJCF_MASS}<freejoint/></body></worldbody>'
    text = mjcf(f'<body name="leg">{MJCF_MASS}<joint name="j"/></body>', excluded.format("leg"))
    both = text.replace("</worldbody>", crate).replace(
        "</mujoco>", excluded.format("crate") + "</mujoco>"
    )
    form = to_canonical(robot(both))
    assert [link.name for link in form.model.links] == ["base", "leg"]
    assert form.changes == ("removed crate: not part of the kinematic tree",)
    assert form.model.excluded == {frozenset({"base", "leg"})}


@pytest.mark.parametrize(
    ("name", "wanted"), [("my robot/../x", "my_robot_.._x"), ("..", "robot"), ("", "robot")]
)
def test_plain_name(name, wanted, robot):
    assert to_canonical(robot(urdf(links="a", name=name))).model.name == wanted


def test_link_named_world_is_renamed(robot):
    joint = urdf_joint("j", "world", "world_link", "fixed")
    form = to_canonical(robot(urdf(joint, links=["world", "world_link"])))
    assert [link.name for link in form.model.links] == ["world_link_2", "world_link"]
    (joint,) = form.model.joints
    assert (joint.parent, joint.child, form.model.floating) == ("world_link_2", "world_link", False)
    assert form.changes == ("renamed link world to world_link_2: MuJoCo reserves the name world",)
    inside = urdf(urdf_joint("j", "a", "world", "fixed"), links=["a", "world"])
    (joint,) = to_canonical(robot(inside)).model.joints
    assert (joint.parent, joint.child) == ("a", "world_link")


# Masses from meshes

MESH = '<mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/>'


def of_mesh(asset, geom="", name=' name="base"'):
    geoms = f'<geom type="mesh" mesh="m" {geom}/>'
    return f"""<mujoco><asset>{asset}</asset><worldbody><body{name}>{geoms}</body></worldbody>
    </mujoco>"""


def test_mass_from_mesh_matches_mujoco(robot, tmp_path):
    trimesh.creation.box((0.1, 0.2, 0.3)).export(tmp_path / "box.stl")
    facts = robot(of_mesh('<mesh name="m" file="box.stl"/>', 'pos="1 2 3" density="1000"'))
    assert facts.total_mass == pytest.approx(6.0, rel=1e-5)
    (link,) = to_canonical(facts).model.links
    assert link.inertial.mass == pytest.approx(6.0, rel=1e-5)
    origin, moments = link.inertial.origin, 6.0 / 12 * np.array([0.13, 0.1, 0.05])
    assert origin[:, 3] == pytest.approx([1, 2, 3, 1])
    inertia = origin[:3, :3] @ link.inertial.inertia @ origin[:3, :3].T
    np.testing.assert_allclose(inertia, np.diag(moments), rtol=1e-4, atol=1e-6)


def test_masses_that_cannot_be_computed(robot):
    with pytest.raises(RobotFileError, match="mass of base: MuJoCo cannot compute it from its"):
        to_canonical(robot(of_mesh('<mesh name="m" file="no.stl"/>')))


def test_unknown_inertia_is_nan():
    known, moments = inertial(1.0), (np.nan, 1, 1)
    cases = [None, known, inertial(None), inertial(np.nan), inertial(1.0, moments)]
    assert [has_unknown_inertia(each) for each in cases] == [False, False, False, True, True]
