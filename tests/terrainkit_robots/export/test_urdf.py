from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
import yourdfpy
from hypothesis import given
from hypothesis import strategies as st
from lxml import etree

from terrainkit_robots.analysis.bodies.kinematics import body_poses
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.description.model import (
    Dynamics,
    Geometry,
    Inertial,
    Joint,
    Limit,
    Link,
    MeshFile,
    Mimic,
    RobotModel,
    Source,
)
from terrainkit_robots.export.canonical import to_canonical
from terrainkit_robots.export.mesh_export.mesh_export import export_meshes
from terrainkit_robots.export.urdf import DEFAULT_EFFORT, DEFAULT_RANGE, DEFAULT_VELOCITY, urdf_text
from terrainkit_robots.lint.rule import rules
from terrainkit_robots.lint.runner import lint
from terrainkit_robots.mesh.mesh_cache import Meshes
from terrainkit_robots.quiet_mujoco import quiet_mujoco

SOURCE = Source(file=Path("robot.urdf"), line=1)


def translated(x, y, z):
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    return pose


def inertial(mass, *moments, origin=None):
    inertia = np.diag(moments or (0.01, 0.01, 0.01)).astype(float)
    return Inertial(
        source=SOURCE, mass=mass, inertia=inertia, origin=np.eye(4) if origin is None else origin
    )


def shape(kind, *size, **fields):
    return Geometry(source=SOURCE, shape=kind, size=size, **fields)


def link(name, mass=1.0, **fields):
    weight = None if mass is None else inertial(mass)
    return Link(name=name, source=SOURCE, **{"inertial": weight, **fields})


def limits(lower=-1.0, upper=1.0, effort=5.0, velocity=7.0):
    return Limit(source=SOURCE, lower=lower, upper=upper, effort=effort, velocity=velocity)


def joint(name, kind, parent, child, **fields):
    given = {"axis": np.array([0.0, 0, 1]), "limit": limits(), **fields}
    return Joint(name=name, source=SOURCE, kind=kind, parent=parent, child=child, **given)


def robot(*parts, **fields):
    return RobotModel(
        name="r",
        kind="urdf",
        file=Path("robot.urdf"),
        source=SOURCE,
        links=tuple(part for part in parts if isinstance(part, Link)),
        joints=tuple(part for part in parts if isinstance(part, Joint)),
        **fields,
    )


def parsed(model, **options):
    return etree.fromstring(urdf_text(model, **options))


def compiled(text):
    with quiet_mujoco():
        return mujoco.MjModel.from_xml_string(text)


def mass_of(model):
    return float(model.body_mass.sum())


def test_urdf_of_box():
    turn = np.eye(4)
    turn[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    base = Link(
        name="base",
        source=SOURCE,
        inertial=inertial(2.0, 0.1, 0.2, 0.25, origin=translated(0.1, 0, 0)),
        visuals=(shape("box", 0.1, 0.2, 0.3, origin=turn, color=(1, 0, 0.5, 1)),),
        collisions=(shape("cylinder", 0.1, 0.2),),
    )
    expected = """\
<robot name="r">
  <!-- Written by terrainkit onboard. SI units and radians. -->
  <mujoco>
    <compiler fusestatic="false" discardvisual="false" strippath="false" balanceinertia="false" \
inertiafromgeom="false"/>
  </mujoco>
  <material name="color_1">
    <color rgba="1 0 0.5 1"/>
  </material>
  <link name="base">
    <inertial>
      <origin xyz="0.1 0 0" rpy="0 0 0"/>
      <mass value="2"/>
      <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.25"/>
    </inertial>
    <visual>
      <origin xyz="0 0 0" rpy="0 0 1.570796327"/>
      <geometry>
        <box size="0.2 0.4 0.6"/>
      </geometry>
      <material name="color_1"/>
    </visual>
    <collision>
      <geometry>
        <cylinder radius="0.1" length="0.4"/>
      </geometry>
    </collision>
  </link>
</robot>
"""
    assert urdf_text(robot(base)) == expected


class TestJoints:
    def test_joint_values(self):
        moving = joint(
            "hip",
            "revolute",
            "base",
            "leg",
            origin=translated(0, 0.1, 0),
            axis=np.array([0.0, 2, 0]),
            limit=limits(-0.5, 1.5, 20, 30),
            dynamics=Dynamics(source=SOURCE, damping=0.3, friction=0.4),
        )
        mimic = Mimic(source=SOURCE, joint="hip", multiplier=-2.0, offset=0.1)
        follower = joint("knee", "revolute", "leg", "shin", mimic=mimic)
        root = parsed(robot(link("base"), link("leg"), link("shin"), moving, follower))
        hip, knee = root.findall("joint")
        assert dict(hip.attrib) == {"name": "hip", "type": "revolute"}
        assert dict(hip.find("origin").attrib) == {"xyz": "0 0.1 0", "rpy": "0 0 0"}
        assert hip.find("parent").get("link") == "base"
        assert hip.find("child").get("link") == "leg"
        assert hip.find("axis").get("xyz") == "0 1 0"
        assert dict(hip.find("limit").attrib) == {
            "lower": "-0.5",
            "upper": "1.5",
            "effort": "20",
            "velocity": "30",
        }
        assert dict(hip.find("dynamics").attrib) == {"damping": "0.3", "friction": "0.4"}
        assert knee.find("dynamics") is None
        assert dict(knee.find("mimic").attrib) == {
            "joint": "hip",
            "multiplier": "-2",
            "offset": "0.1",
        }

    def test_unknown_limits_have_defaults_and_comment(self):
        bare = [
            joint("a", "continuous", "base", "one", limit=None),
            joint("b", "prismatic", "base", "two", limit=limits(None, None, None, None)),
            joint("c--d", "revolute", "base", "three", limit=limits(2, 1, 3, 4)),
        ]
        text = urdf_text(robot(link("base"), link("one"), link("two"), link("three"), *bare))
        a, b, c = etree.fromstring(text).findall("joint")
        assert dict(a.find("limit").attrib) == {
            "effort": f"{DEFAULT_EFFORT:g}",
            "velocity": f"{DEFAULT_VELOCITY:g}",
        }
        assert b.find("limit").get("lower") == f"{-DEFAULT_RANGE:g}"
        assert b.find("limit").get("upper") == f"{DEFAULT_RANGE:g}"
        assert c.get("type") == "continuous"
        assert "<!-- Unknown effort limit, set to 1000: a, b. -->" in text
        assert "<!-- Unknown velocity limit, set to 100: a, b. -->" in text
        assert compiled(text).njnt == 3

    def test_names_cannot_end_comment(self):
        model = robot(
            link("base"), link("leg"), joint("a--b-", "continuous", "base", "leg", limit=None)
        )
        assert parsed(model).find("joint").get("name") == "a--b-"

    @pytest.mark.parametrize("name", ["a---b", "-", "--", "a-----", "-- -- >", "->", "<!---->"])
    def test_hyphens_cannot_end_comment(self, name):
        model = robot(link("base"), link("leg"), joint(name, "revolute", "base", "leg", limit=None))
        assert parsed(model).find("joint").get("name") == name

    @given(
        st.lists(
            st.text("-a") | st.text(st.characters(exclude_categories=("C", "Z"))),
            min_size=1,
            max_size=4,
        )
    )
    def test_comment_with_any_names(self, names):
        links = [link(f"l{k}") for k in range(len(names) + 1)]
        joints = [
            joint(name, "revolute", "l0", f"l{k}", limit=None) for k, name in enumerate(names, 1)
        ]
        root = parsed(robot(*links, *joints))
        assert [each.get("name") for each in root.iterfind("joint")] == names
        (comment, *_) = [c.text for c in root.iter(etree.Comment) if "effort" in c.text]
        told = ", ".join(names)
        assert comment.replace(" ", "").endswith(f"{told}.".replace(" ", ""))

    def test_feet_have_dont_collapse(self):
        model = robot(
            link("base"),
            link("leg"),
            link("foot"),
            link("camera"),
            joint("hip", "revolute", "base", "leg"),
            joint("ankle", "fixed", "leg", "foot"),
            joint("mount", "fixed", "base", "camera"),
        )
        written = parsed(model, feet=["foot", "leg"])
        kept = {j.get("name"): j.get("dont_collapse") for j in written.iter("joint")}
        assert kept == {"hip": None, "ankle": "true", "mount": None}
        told = replace(model.joints[2], dont_collapse=True)
        again = parsed(replace(model, joints=(*model.joints[:2], told)))
        assert [j.get("dont_collapse") for j in again.iter("joint")] == [None, None, "true"]

    def test_noncanonical_joint_is_rejected(self):
        model = robot(link("base"), link("leg"), joint("hip", "ball", "base", "leg"))
        with pytest.raises(ValueError, match="joint hip: got type ball"):
            urdf_text(model)


class TestMasses:
    def test_declared_masses(self):
        """Shapes weigh nothing, whether or not their links do."""
        heavy = (shape("box", 1, 1, 1),)
        model = robot(
            link("base", 3.0, collisions=heavy),
            link("leg", 1.0, collisions=heavy),
            link("foot", None, collisions=heavy),
            joint("hip", "revolute", "base", "leg"),
            joint("ankle", "fixed", "leg", "foot"),
        )
        made = compiled(urdf_text(model))
        assert mass_of(made) == pytest.approx(4, abs=2e-6)
        assert [made.body(k).name for k in range(4)] == ["world", "base", "leg", "foot"]

    def test_massless_moving_link_gets_minimum_mass(self):
        model = robot(
            link("base", 3.0),
            link("between", None, virtual=True),
            link("leg", None),
            link("tip", None),
            joint("a", "revolute", "base", "between"),
            joint("b", "revolute", "between", "leg"),
            joint("c", "fixed", "leg", "tip"),
        )
        text = urdf_text(model)
        links = etree.fromstring(text).iter("link")
        masses = {each.get("name"): each.find("inertial/mass") for each in links}
        assert {name: mass is not None and mass.get("value") for name, mass in masses.items()} == {
            "base": "3",
            "between": "1e-07",
            "leg": "1e-07",
            "tip": False,
        }
        assert mass_of(compiled(text)) == pytest.approx(3, rel=1e-6)

    def test_massless_frame_with_fixed_mass(self):
        model = robot(
            link("base", 3.0),
            link("frame", None),
            link("leg", 2.0),
            joint("a", "revolute", "base", "frame"),
            joint("b", "fixed", "frame", "leg"),
        )
        text = urdf_text(model)
        assert etree.fromstring(text).find("link[@name='frame']/inertial") is None
        assert mass_of(compiled(text)) == 5

    @pytest.mark.skipif(
        tuple(map(int, mujoco.__version__.split(".")[:2])) < (3, 14),
        reason="MuJoCo before 3.14 ignores the rpy of <inertial> in a URDF",
    )
    def test_inertia_frame(self):
        """Twelve numbers that tell every axis from every other."""
        origin = translated(0.1, -0.2, 0.3)
        quat = np.array([0.5, -0.1, 0.7, 0.2])
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, quat / np.linalg.norm(quat))
        origin[:3, :3] = turn.reshape(3, 3)
        weight = replace(inertial(2.0), inertia=np.diag([0.03, 0.04, 0.05]), origin=origin)
        model = robot(link("base", inertial=weight))
        body = compiled(urdf_text(model)).body("base")
        assert body.ipos == pytest.approx(origin[:3, 3])
        mujoco.mju_quat2Mat(turn, body.iquat)
        back = turn.reshape(3, 3) @ np.diag(body.inertia) @ turn.reshape(3, 3).T
        wanted = origin[:3, :3] @ np.diag([0.03, 0.04, 0.05]) @ origin[:3, :3].T
        np.testing.assert_allclose(back, wanted, rtol=1e-6, atol=1e-9)


class TestShapes:
    def test_capsule_is_cylinder_and_two_spheres(self):
        turn = translated(0, 0, 1)
        turn[:3, :3] = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]  # z of the shape is x of the link
        root = parsed(robot(link("base", collisions=(shape("capsule", 0.1, 0.3, origin=turn),))))
        rod, *balls = root.find("link").findall("collision")
        assert dict(rod.find("geometry/cylinder").attrib) == {"radius": "0.1", "length": "0.6"}
        assert [ball.find("origin").get("xyz") for ball in balls] == ["0.3 0 1", "-0.3 0 1"]
        assert [b.find("geometry/sphere").get("radius") for b in balls] == ["0.1", "0.1"]

    def test_meshes_and_ellipsoids(self):
        file = MeshFile(source=SOURCE, filename="meshes/a.stl", path=Path("a"), scale=(1, 2, 1))
        shapes = (
            shape("mesh", mesh=file),
            shape("ellipsoid", 1, 2, 3, mesh=replace(file, scale=(1.0, 1.0, 1.0))),
            shape("ellipsoid", 1, 1, 1),
        )
        elements = parsed(robot(link("base", visuals=shapes))).findall("link/visual/geometry/*")
        assert [(e.tag, dict(e.attrib)) for e in elements] == [
            ("mesh", {"filename": "meshes/a.stl", "scale": "1 2 1"}),
            ("mesh", {"filename": "meshes/a.stl"}),
            ("sphere", {"radius": "1"}),
        ]

    @pytest.mark.parametrize("kind", ["plane", "unknown", "ellipsoid"])
    def test_unsupported_shape_is_rejected(self, kind):
        size = (1, 2, 3) if kind == "ellipsoid" else ()
        with pytest.raises(ValueError, match=kind):
            urdf_text(robot(link("base", visuals=(shape(kind, *size),))))

    def test_geometry_without_contacts(self):
        ghost = shape("sphere", 0.1, contype=0, conaffinity=0)
        assert parsed(robot(link("base", collisions=(ghost,)))).find("link/collision") is None


def test_axis_with_offset():
    """The child turns about the axis, and is where it was in between."""
    anchor = np.array([0.1, -0.2, 0.3])
    moved = joint(
        "hip",
        "revolute",
        "base",
        "leg",
        origin=translated(1, 2, 3),
        anchor=anchor,
        axis=np.array([0.0, 0.6, 0.8]),
    )
    model = robot(
        link("base"),
        link("leg"),
        link("leg_axis"),
        moved,
        joint("tail", "fixed", "base", "leg_axis"),
    )
    text = urdf_text(model)
    made = compiled(text)
    data = mujoco.MjData(made)
    facts = Facts(model)
    for q in (0.0, 0.7, -1.0):
        data.qpos[:] = q
        mujoco.mj_kinematics(made, data)
        pose = body_poses(facts.bodies, {"hip": q})[1]
        assert data.body("leg").xpos == pytest.approx(pose[:3, 3], abs=1e-8)
        np.testing.assert_allclose(data.body("leg").xmat.reshape(3, 3), pose[:3, :3], atol=1e-8)
    assert [made.body(k).name for k in range(1, made.nbody)].count("leg_axis") == 1
    assert mass_of(made) == pytest.approx(3, rel=1e-6)


def test_text_is_deterministic():
    model = to_canonical(Facts(load_robot(bundled.urdf_path("biped")))).model
    assert urdf_text(model) == urdf_text(model)


BUNDLED = ["quadruped.urdf", "quadruped.xml", "biped.urdf", "biped.xml"]
SHARED = ["go2/urdf/go2.urdf", "h1/urdf/h1.urdf", "a1/urdf/a1.urdf"]


class Written:
    """A robot and what was written of it."""

    def __init__(self, file, folder):
        self.source = Facts(load_robot(file))
        packed = export_meshes(to_canonical(self.source).model, self.source.meshes)
        for name, data in packed.files.items():
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_bytes(data)
        self.path = folder / "robot.urdf"
        self.path.write_text(urdf_text(packed.model))


@pytest.fixture(scope="module", params=BUNDLED + SHARED)
def written(request, robot_file, tmp_path_factory):
    name = request.param
    folder = Path(bundled.__file__).parent
    file = robot_file(name) if "/" in name else folder / name.partition(".")[0] / name
    return Written(file, tmp_path_factory.mktemp("robot"))


class TestRobots:
    def test_mujoco_loads_urdf(self, written):
        """Names, masses and kinematics equal the source."""
        with quiet_mujoco():
            model = mujoco.MjModel.from_xml_path(str(written.path))
        facts = written.source
        assert mass_of(model) == pytest.approx(facts.total_mass, rel=1e-6)
        names = {model.body(k).name for k in range(model.nbody)}
        assert {each.name for each in facts.links} <= names
        data = mujoco.MjData(model)
        rng = np.random.default_rng(0)
        for _ in range(20):
            q = {j.name: rng.uniform(*(j.range or (-3, 3))) for j in facts.joints}
            for name, position in q.items():
                data.joint(name).qpos[0] = position
            mujoco.mj_kinematics(model, data)
            trunk = data.body(facts.bodies[0].top.name)
            turn, place = trunk.xmat.reshape(3, 3), trunk.xpos
            for body, pose in zip(facts.bodies, body_poses(facts.bodies, q), strict=True):
                there = data.body(body.top.name)
                assert turn.T @ (there.xpos - place) == pytest.approx(pose[:3, 3], abs=1e-7)
                assert turn.T @ there.xmat.reshape(3, 3) == pytest.approx(pose[:3, :3], abs=1e-7)

    def test_yourdfpy_loads_urdf(self, written):
        robot = yourdfpy.URDF.load(str(written.path), load_meshes=False)
        facts = written.source
        rng = np.random.default_rng(1)
        q = {j.name: rng.uniform(*(j.range or (-3, 3))) for j in facts.joints}
        robot.update_cfg({name: value for name, value in q.items() if name in robot.joint_map})
        for body, pose in zip(facts.bodies, body_poses(facts.bodies, q), strict=True):
            there = robot.get_transform(body.top.name, facts.bodies[0].top.name)
            np.testing.assert_allclose(there, pose, atol=1e-7)

    def test_load_robot_reads_urdf(self, written):
        """No problem of reading, no mesh that is lost, no other joint order."""
        model = load_robot(written.path)
        facts = Facts(model, Meshes())
        assert not model.problems
        assert [j.name for j in facts.joints] == [j.name for j in written.source.joints]
        assert [j.range for j in facts.joints] == [
            j.range and pytest.approx(j.range, rel=1e-9) for j in written.source.joints
        ]
        families = {"XML", "MSH", "TRE"}
        chosen = [each for each in rules() if each.code[:3] in families]
        found = [f for f in lint(facts, chosen).findings if f.severity == "error"]
        assert not found
