from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lxml import etree

from terrainkit_robots.analysis.bodies.kinematics import body_poses
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.description.model import Dynamics, Mimic
from terrainkit_robots.export.canonical import to_canonical
from terrainkit_robots.export.mesh_export.mesh_export import export_meshes
from terrainkit_robots.export.urdf import urdf_text
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.transforms import quat_to_matrix, rpy_to_matrix
from tests.robots import ROBOTS
from tests.tables import read_table
from tests.terrainkit_robots.export.made_models import (
    SOURCE,
    at,
    inertial,
    joint,
    limits,
    link,
    model,
    shape,
)


def parsed(robot, **options):
    return etree.fromstring(urdf_text(robot, **options))


def compiled(text):
    with quiet_mujoco():
        return mujoco.MjModel.from_xml_string(text)


def masses(robot):
    """Return the mass of each link as written; None if it has none."""
    links = {each.get("name"): each.find("inertial/mass") for each in parsed(robot).iter("link")}
    return {name: None if mass is None else mass.get("value") for name, mass in links.items()}


def test_urdf_of_box():
    turned = at(0, 0, 0, [[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    base = link(
        "base",
        inertial=inertial(2.0, (0.1, 0.2, 0.25), at(0.1, 0, 0)),
        visuals=(shape("box", 0.1, 0.2, 0.3, origin=turned, color=(1, 0, 0.5, 1)),),
        collisions=(shape("cylinder", 0.1, 0.2), shape("sphere", 1, contype=0, conaffinity=0)),
    )
    expected = read_table(__file__, "urdf_of_box")
    assert urdf_text(model(base)) == expected


def elements(joint):
    """Return the attributes of a joint and of each element in it."""
    return {"": dict(joint.attrib), **{each.tag: dict(each.attrib) for each in joint}}


def test_joint_values():
    losses = Dynamics(source=SOURCE, damping=0.3, friction=0.4)
    fields = {"axis": np.array([0.0, 2, 0]), "limit": limits(-0.5, 1.5, 20, 30)}
    hip = joint("hip", "revolute", "base", "leg", origin=at(0, 0.1, 0), dynamics=losses, **fields)
    mimic = Mimic(source=SOURCE, joint="hip", multiplier=-2.0, offset=0.1)
    knee = joint("knee", "prismatic", "leg", "shin", mimic=mimic)
    root = parsed(model(link("base"), link("leg"), link("shin"), hip, knee))
    assert list(map(elements, root.findall("joint"))) == [
        {
            "": {"name": "hip", "type": "revolute"},
            "origin": {"xyz": "0 0.1 0", "rpy": "0 0 0"},
            "parent": {"link": "base"},
            "child": {"link": "leg"},
            "axis": {"xyz": "0 1 0"},
            "limit": {"lower": "-0.5", "upper": "1.5", "effort": "20", "velocity": "30"},
            "dynamics": {"damping": "0.3", "friction": "0.4"},
        },
        {
            "": {"name": "knee", "type": "prismatic"},
            "parent": {"link": "leg"},
            "child": {"link": "shin"},
            "axis": {"xyz": "0 0 1"},
            "limit": {"lower": "-1", "upper": "1", "effort": "5", "velocity": "7"},
            "mimic": {"joint": "hip", "multiplier": "-2", "offset": "0.1"},
        },
    ]


def test_unknown_limits_have_defaults_and_comment():
    bare = [
        joint("a", "continuous", "base", "one", limit=None),
        joint("b", "prismatic", "base", "two", limit=limits(None, None, None, None)),
        joint("c--d", "revolute", "base", "three", limit=limits(2, 1, 3, 4)),
    ]
    text = urdf_text(model(*map(link, ("base", "one", "two", "three")), *bare))
    joints = [elements(each) for each in etree.fromstring(text).findall("joint")]
    assert [each["limit"] for each in joints] == [
        {"effort": "1000", "velocity": "100"},
        {"lower": "-1000", "upper": "1000", "effort": "1000", "velocity": "100"},
        {"effort": "3", "velocity": "4"},
    ]
    assert joints[2][""] == {"name": "c--d", "type": "continuous"}
    for what in ("effort limit, set to 1000: a, b", "position limit, set to 1000: b"):
        assert f"<!-- Unknown {what}. -->" in text
    assert "<!-- Unknown velocity limit, set to 100: a, b. -->" in text
    assert compiled(text).njnt == 3


@given(
    st.lists(
        st.text("-a >!<", min_size=1) | st.text(st.characters(exclude_categories=("C", "Z"))),
        min_size=1,
        max_size=4,
    )
)
def test_names_cannot_end_comment(names):
    links = [link(f"l{k}") for k in range(len(names) + 1)]
    joints = [joint(name, "revolute", "l0", f"l{k}", limit=None) for k, name in enumerate(names, 1)]
    root = parsed(model(*links, *joints))
    assert [each.get("name") for each in root.iterfind("joint")] == names
    (comment, *_) = [c.text for c in root.iter(etree.Comment) if "effort" in c.text]
    told = ", ".join(names)
    assert comment.replace(" ", "").endswith(f"{told}.".replace(" ", ""))


def test_feet_have_dont_collapse():
    hip = joint("hip", "revolute", "base", "leg")
    ankle, mount = joint("ankle", "fixed", "leg", "foot"), joint("mount", "fixed", "base", "camera")
    links = [link(name) for name in ("base", "leg", "foot", "camera")]

    def kept(*joints, **options):
        root = parsed(model(*links, *joints), **options)
        return [each.get("dont_collapse") for each in root.iter("joint")]

    assert kept(hip, ankle, mount, feet=["foot", "leg"]) == [None, "true", None]
    told = replace(hip, dont_collapse=True), ankle, replace(mount, dont_collapse=True)
    assert kept(*told) == [None, None, "true"]


def test_axis_with_offset():
    """The child turns about the axis, and is where it was in between; names are kept unique."""
    place = {"anchor": np.array([0.1, -0.2, 0.3]), "axis": np.array([0.0, 0.6, 0.8])}
    hip = joint("hip", "revolute", "base", "leg", origin=at(1, 2, 3), **place)
    tail = joint("tail", "fixed", "base", "leg_axis")
    robot = model(link("base"), link("leg"), link("leg_axis"), hip, tail)
    made = compiled(urdf_text(robot))
    names = [made.body(k).name for k in range(1, made.nbody)]
    assert names == ["base", "leg_axis_2", "leg", "leg_axis"]
    data = mujoco.MjData(made)
    for q in (0.0, 0.7):
        data.qpos[:] = q
        mujoco.mj_kinematics(made, data)
        pose = body_poses(Facts(robot).bodies, {"hip": q})[1]
        assert data.body("leg").xpos == pytest.approx(pose[:3, 3], abs=1e-8)
        np.testing.assert_allclose(data.body("leg").xmat.reshape(3, 3), pose[:3, :3], atol=1e-8)
    assert made.body_mass.sum() == pytest.approx(3, rel=1e-6)
    # A slide is the same on every parallel axis.
    slide = replace(robot, joints=(replace(hip, kind="prismatic"), tail))
    assert compiled(urdf_text(slide)).nbody == 4


def test_joint_that_is_not_canonical_is_rejected():
    robot = model(link("base"), link("leg"), joint("hip", "ball", "base", "leg"))
    with pytest.raises(ValueError, match="joint hip: got type ball; expected a canonical"):
        urdf_text(robot)


def test_links_that_need_a_mass_get_a_small_one():
    """A link moves, is virtual, or has a shape from which its mass would be computed."""
    heavy = (shape("box", 1, 1, 1),)
    robot = model(
        link("base", 3.0, collisions=heavy),
        link("between", None, virtual=True),
        link("leg", None),
        link("tip", None),
        link("foot", None, collisions=heavy),
        joint("a", "revolute", "base", "between"),
        joint("b", "revolute", "between", "leg"),
        joint("c", "fixed", "leg", "tip"),
        joint("d", "fixed", "base", "foot"),
    )
    small = dict.fromkeys(("between", "leg", "foot"), "1e-07")
    assert masses(robot) == {"base": "3", "tip": None} | small
    made = compiled(urdf_text(robot))
    assert made.body_mass.sum() == pytest.approx(3, rel=1e-6)
    inertia = parsed(robot).find("link[@name='leg']/inertial/inertia")
    assert [inertia.get(name) for name in ("ixx", "iyy", "izz", "ixy")] == ["1e-13"] * 3 + ["0"]


@pytest.mark.parametrize(("mass", "small"), [(0.5, "5e-08"), (1.0, "1e-07"), (None, "1e-07")])
def test_small_mass_is_a_share_of_the_robot(mass, small):
    robot = model(link("base", mass), link("leg", None), joint("a", "revolute", "base", "leg"))
    assert masses(robot)["leg"] == small


def test_massless_link_with_a_fixed_mass_needs_none():
    links = link("base", 3.0), link("frame", None), link("leg", 2.0)
    joints = joint("a", "revolute", "base", "frame"), joint("b", "fixed", "frame", "leg")
    robot = model(*links, *joints)
    assert masses(robot) == {"base": "3", "frame": None, "leg": "2"}
    assert compiled(urdf_text(robot)).body_mass.sum() == 5


@pytest.mark.skipif(
    tuple(map(int, mujoco.__version__.split(".")[:2])) < (3, 14),
    reason="MuJoCo before 3.14 ignores the rpy of <inertial> in a URDF",
)
def test_inertia_frame():
    """Twelve numbers that tell every axis from every other."""
    turn, moments = rpy_to_matrix(np.array([0.5, -0.1, 0.7])), (0.03, 0.04, 0.05)
    weight = inertial(2.0, moments, at(0.1, -0.2, 0.3, turn))
    body = compiled(urdf_text(model(link("base", inertial=weight)))).body("base")
    assert body.ipos == pytest.approx([0.1, -0.2, 0.3])
    axes = quat_to_matrix(body.iquat)
    wanted = turn @ np.diag(moments) @ turn.T
    np.testing.assert_allclose(axes @ np.diag(body.inertia) @ axes.T, wanted, rtol=1e-6, atol=1e-9)


def test_rounding_errors_of_inertia_are_zero():
    inertia = np.array([[1, 0.9e-12, 1.1e-12], [0.9e-12, 1, 0], [1.1e-12, 0, 1]])
    weight = replace(inertial(2.0), inertia=inertia)
    written = parsed(model(link("base", inertial=weight))).find("link/inertial/inertia")
    assert [written.get(name) for name in ("ixx", "ixy", "ixz")] == ["1", "0", "1.1e-12"]


@pytest.fixture(scope="module", params=ROBOTS)
def written(request, robot_file, tmp_path_factory):
    """Return a robot, and the URDF that is written of it."""
    source = Facts(load_robot(robot_file(request.param)))
    robot = to_canonical(source).model
    packed = export_meshes(robot, source.meshes)
    assert packed.files == {}
    path = tmp_path_factory.mktemp("robot") / "robot.urdf"
    path.write_text(urdf_text(packed.model))
    return source, path


def random_positions(facts, seed):
    rng = np.random.default_rng(seed)
    return {each.name: rng.uniform(*(each.range or (-3, 3))) for each in facts.joints}


def test_mujoco_reads_the_same_robot(written):
    facts, path = written
    with quiet_mujoco():
        made = mujoco.MjModel.from_xml_path(str(path))
    assert made.body_mass.sum() == pytest.approx(facts.total_mass, rel=1e-6)
    assert {each.name for each in facts.links} <= {made.body(k).name for k in range(made.nbody)}
    data = mujoco.MjData(made)
    for seed in range(3):
        q = random_positions(facts, seed)
        for name, position in q.items():
            data.joint(name).qpos[0] = position
        mujoco.mj_kinematics(made, data)
        trunk = data.body(facts.bodies[0].top.name)
        turn, place = trunk.xmat.reshape(3, 3), trunk.xpos
        for body, pose in zip(facts.bodies, body_poses(facts.bodies, q), strict=True):
            there = data.body(body.top.name)
            assert turn.T @ (there.xpos - place) == pytest.approx(pose[:3, 3], abs=1e-7)
            assert turn.T @ there.xmat.reshape(3, 3) == pytest.approx(pose[:3, :3], abs=1e-7)
