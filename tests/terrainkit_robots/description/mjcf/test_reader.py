"""MJCF is read as MuJoCo compiles it, and what MuJoCo refuses is told and read around."""

import random
import re
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import mujoco
import numpy as np
import pytest

from terrainkit_robots.analysis.bodies.bodies import merge_bodies
from terrainkit_robots.analysis.bodies.kinematics import body_poses
from terrainkit_robots.analysis.bodies.tree import build_tree
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.description.mjcf.tree import MAX_ELEMENTS
from terrainkit_robots.description.model import Geometry, Joint, Link, Problem, RobotModel
from terrainkit_robots.transforms import Matrix

EXACT = 1e-9 if int(mujoco.__version__.split(".")[0]) > 3 else 1e-6
"""MuJoCo 3 finds the principal axes of an inertia less exactly."""


def read(text: str | bytes, file: Path = Path("robot.xml")) -> RobotModel:
    data = text.encode() if isinstance(text, str) else text
    return load_robot(file, contents={file: data})


def in_world(inside: str, rest: str = "") -> str:
    return f"<mujoco>{rest}<worldbody>{inside}</worldbody></mujoco>"


def only(robot: RobotModel) -> Problem:
    assert len(robot.problems) == 1, robot.problems
    return robot.problems[0]


def codes(robot: RobotModel) -> list[str]:
    return [problem.code for problem in robot.problems]


def joint(robot: RobotModel, name: str) -> Joint:
    return next(joint for joint in robot.joints if joint.name == name)


def link(robot: RobotModel, name: str) -> Link:
    return next(link for link in robot.links if link.name == name)


# Against MuJoCo's compiler


def compiled(text: str) -> mujoco.MjModel:
    """Compile a model; what MuJoCo warns of would be written to a file."""
    mujoco.set_mju_user_warning(lambda _: None)
    try:
        return mujoco.MjModel.from_xml_string(text)
    finally:
        mujoco.set_mju_user_warning(None)


def turn(quat: Matrix) -> Matrix:
    flat = np.zeros(9)
    mujoco.mju_quat2Mat(flat, quat)
    return flat.reshape(3, 3)


def pose(pos: Matrix, quat: Matrix) -> Matrix:
    whole = np.eye(4)
    whole[:3, :3], whole[:3, 3] = turn(quat), pos
    return whole


def same_pose(ours: Matrix, theirs: Matrix) -> None:
    np.testing.assert_allclose(ours, theirs, atol=EXACT)


def assert_compiled(robot: RobotModel, model: mujoco.MjModel) -> None:
    """Everything that the compiler has is in the robot, to 1e-9."""
    links = [each for each in robot.links if not each.virtual]
    assert [each.name for each in links] == [model.body(k).name for k in range(1, model.nbody)]
    virtual = {each.name for each in robot.links if each.virtual}
    above = {each.child: each for each in robot.joints}
    for k, each in enumerate(links, 1):
        parent = model.body(model.body_parentid[k]).name
        first = above[each.name]
        while first.parent in virtual:
            first = above[first.parent]
        assert first.parent == parent
        same_pose(first.origin, pose(model.body_pos[k], model.body_quat[k]))
        assert_inertia(each, model, k)
    assert_joints(robot, model)
    assert_shapes(links, model)


def assert_inertia(link: Link, model: mujoco.MjModel, k: int) -> None:
    inertial = link.inertial
    if inertial is None:
        assert model.body_mass[k] == 0
        return
    assert inertial.mass == pytest.approx(model.body_mass[k], abs=EXACT)
    assert inertial.inertia is not None
    axes, theirs = turn(model.body_iquat[k]), np.diag(model.body_inertia[k])
    ours = inertial.origin[:3, :3] @ inertial.inertia @ inertial.origin[:3, :3].T
    np.testing.assert_allclose(ours, axes @ theirs @ axes.T, atol=EXACT)
    np.testing.assert_allclose(inertial.origin[:3, 3], model.body_ipos[k], atol=EXACT)


def assert_joints(robot: RobotModel, model: mujoco.MjModel) -> None:
    moving = [each for each in robot.joints if each.kind != "fixed"]
    assert len(moving) == model.njnt
    for k, each in enumerate(moving):
        kind = mujoco.mjtJoint(model.jnt_type[k])
        if kind in (mujoco.mjtJoint.mjJNT_FREE, mujoco.mjtJoint.mjJNT_BALL):
            free = kind == mujoco.mjtJoint.mjJNT_FREE
            assert each.kind == ("floating" if free else "ball")
            continue
        np.testing.assert_allclose(each.direction, model.jnt_axis[k], atol=EXACT)
        np.testing.assert_allclose(each.anchor, model.jnt_pos[k], atol=EXACT)
        assert each.reference == pytest.approx(model.qpos0[model.jnt_qposadr[k]], abs=EXACT)
        assert each.damping == pytest.approx(
            model.dof_damping.reshape(model.nv, -1)[model.jnt_dofadr[k], 0], abs=EXACT
        )
        assert each.armature == pytest.approx(model.dof_armature[model.jnt_dofadr[k]], abs=EXACT)
        lost = model.dof_frictionloss[model.jnt_dofadr[k]]
        assert each.friction == pytest.approx(lost, abs=EXACT)
        if model.jnt_limited[k]:
            assert each.limit is not None
            bounds = (each.limit.lower, each.limit.upper)
            np.testing.assert_allclose(bounds, model.jnt_range[k], atol=EXACT)
        if model.jnt_actfrclimited[k]:
            assert each.limit is not None
            assert each.limit.effort == pytest.approx(abs(model.jnt_actfrcrange[k]).max())


def assert_shapes(links: list[Link], model: mujoco.MjModel) -> None:
    for k, each in enumerate(links, 1):
        shapes = sorted((*each.collisions, *each.visuals), key=lambda s: s.source.line)
        theirs = [g for g in range(model.ngeom) if model.geom_bodyid[g] == k]
        assert len(shapes) == len(theirs)
        for shape, g in zip(shapes, theirs, strict=True):
            if shape.shape == "mesh":
                continue
            same_pose(shape.origin, pose(model.geom_pos[g], model.geom_quat[g]))
            np.testing.assert_allclose(
                shape.size, model.geom_size[g][: len(shape.size)], atol=EXACT
            )


def compiled_without_meshes(file: Path) -> mujoco.MjModel:
    spec = mujoco.MjSpec.from_file(str(file))
    for geom in list(spec.geoms):
        if geom.type == mujoco.mjtGeom.mjGEOM_MESH:
            spec.delete(geom)
    for mesh in list(spec.meshes):
        spec.delete(mesh)
    return spec.compile()


@pytest.mark.parametrize("name", ["h1/h1.xml", "g1/g1_29dof.xml", "go2_mjcf/go2.xml"])
def test_published_robots_match_mujoco(name: str, robot_file: Callable[[str], Path]) -> None:
    file = robot_file(name)
    robot, model = load_robot(file), compiled_without_meshes(file)
    assert robot.problems == ()
    for each in robot.links:  # the model has no meshes
        assert {s.shape for s in each.visuals} <= {"mesh"}
    bare = [
        Link(
            name=each.name,
            source=each.source,
            inertial=each.inertial,
            collisions=tuple(s for s in each.collisions if s.shape != "mesh"),
        )
        for each in robot.links
    ]
    assert_compiled(
        RobotModel(
            name=robot.name,
            kind="mjcf",
            file=file,
            source=robot.source,
            links=tuple(bare),
            joints=robot.joints,
        ),
        model,
    )
    assert [each.joint for each in robot.actuators] == [
        model.joint(model.actuator_trnid[k, 0]).name for k in range(model.nu)
    ]


def test_go2_home_and_torque_limits(robot_file: Callable[[str], Path]) -> None:
    robot = load_robot(robot_file("go2_mjcf/go2.xml"))
    assert robot.keyframe["RR_calf_joint"] == -1.8
    assert robot.imu is not None
    name, place = robot.imu
    assert name == "base_link"
    np.testing.assert_allclose(place[:3, 3], [-0.02557, 0, 0.04232], atol=1e-12)
    assert [each.effort for each in robot.actuators] == [23.7, 23.7, 45.43] * 4
    limit = joint(robot, "FL_calf_joint").limit
    assert limit is not None
    assert limit.effort == 45.43
    assert {m.path.name for each in robot.links if (m := mesh_of(each))} >= {"base_0.obj"}


def mesh_of(link: Link) -> Path | None:
    return next((s.mesh for s in link.visuals if s.mesh), None)  # type: ignore[return-value]


EVERYTHING = """
<mujoco model="everything">
  <compiler angle="degree" eulerseq="ZYx" autolimits="true"/>
  <option><flag contact="enable"/></option>
  <default>
    <joint damping="0.5" armature="0.01" frictionloss="0.2"/>
    <geom density="500"/>
    <default class="limb">
      <joint axis="0 1 0" range="-30 60" actuatorfrcrange="-20 20"/>
      <geom type="capsule" size="0.02"/>
      <default class="heavy"><geom density="2000" pos="0 0 0.1"/></default>
    </default>
  </default>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body name="trunk" pos="0 0 1" euler="10 20 30">
      <freejoint name="root"/>
      <inertial pos="0.1 0 0" quat="1 2 3 4" mass="3" diaginertia="0.1 0.2 0.25"/>
      <geom type="box" size="0.1 0.2 0.3" euler="0 0 45"/>
      <frame pos="0 0 0.5" axisangle="0 0 1 90" childclass="limb">
        <geom fromto="0 0 0 0.1 0.2 0.3"/>
        <body name="framed" pos="1 0 0">
          <inertial pos="0 0 0.1" mass="1" fullinertia="0.1 0.2 0.25 0.01 0.02 -0.03"/>
          <frame euler="0 90 0"><joint name="in_frame" pos="0.1 0 0"/></frame>
          <frame pos="0 0 1"><frame zaxis="1 1 0"><geom type="sphere" size="0.1"/></frame></frame>
        </body>
      </frame>
      <body name="leg" childclass="limb" pos="0 0.1 0" xyaxes="0 1 0 -1 0 0">
        <joint name="swing"/>
        <joint name="lift" axis="1 0 0" ref="15" pos="0 0 0.05"/>
        <joint name="slide" type="slide" range="-0.1 0.2" ref="0.05" axis="0 0 3"/>
        <geom fromto="0 0 0 0 0 -0.3"/>
        <geom class="heavy" type="sphere" size="0.05"/>
        <geom type="cylinder" fromto="0.1 0 0 0 0 0.2" size="0.03" mass="0.7"/>
        <geom type="box" fromto="0.1 0.1 0 0 0 0.2" size="0.03"/>
        <geom type="ellipsoid" fromto="0 0 0.3 0 0 0.5" size="0.03"/>
        <geom type="ellipsoid" size="0.1 0.2 0.3" group="1" contype="0" conaffinity="0"/>
        <geom type="sphere" size="0.3" mass="0"/>
        <body name="foot" pos="0 0 -0.3"><geom type="sphere" size="0.02"/></body>
        <body name="hand" pos="0 0 -0.1"><joint type="ball" name="wrist" class="main"/>
          <geom size="0.1 0.2"/></body>
      </body>
      <replicate count="3" offset="0 0.1 0" euler="0 0 20">
        <body name="fin"><joint name="flap" class="limb" range="0 10"/><geom size="0.01"/></body>
      </replicate>
    </body>
    <body name="post" pos="2 0 0"><geom type="cylinder" size="0.1 0.2"/></body>
  </worldbody>
  <contact><exclude body1="trunk" body2="leg"/></contact>
</mujoco>
"""


def test_model_matches_mujoco() -> None:
    robot = read(EVERYTHING)
    assert robot.problems == ()
    assert robot.name == "everything"
    assert_compiled(robot, compiled(EVERYTHING))


def test_link_poses_match_mujoco() -> None:
    robot, model = read(EVERYTHING), compiled(EVERYTHING)
    data = mujoco.MjData(model)
    bodies = merge_bodies(build_tree(robot))
    rng = np.random.default_rng(0)
    for _ in range(5):
        positions = {}
        data.qpos[:7] = (0, 0, 0, 1, 0, 0, 0)
        for each in robot.joints:
            if each.moves:
                positions[each.name] = rng.uniform(-1, 1)
                data.joint(each.name).qpos[0] = positions[each.name]
        mujoco.mj_kinematics(model, data)
        poses = body_poses(bodies, positions)
        for body, at in zip(bodies, poses, strict=True):
            for each, local in zip(body.links, body.poses, strict=True):
                if not each.virtual:
                    theirs = data.body(each.name)
                    same_pose(at @ local, pose(theirs.xpos, theirs.xquat))


def test_joints_of_one_body_have_virtual_links() -> None:
    robot = read(EVERYTHING)
    between = [each.name for each in robot.links if each.virtual]
    assert between == ["leg:swing", "leg:lift"]
    swing, lift, slide = (joint(robot, name) for name in ("swing", "lift", "slide"))
    assert [swing.parent, lift.parent, slide.parent] == ["trunk", "leg:swing", "leg:lift"]
    assert slide.child == "leg"
    assert slide.kind == "prismatic"


def test_root_bodies_have_parent_world() -> None:
    robot = read(EVERYTHING)
    assert joint(robot, "root").kind == "floating"
    assert {each.child for each in robot.joints if each.parent == "world"} == {"trunk", "post"}
    assert joint(robot, "post_fixed").kind == "fixed"
    assert joint(robot, "foot_fixed").parent == "leg"
    assert joint(robot, "wrist").kind == "ball"


def test_home_is_first_keyframe_with_positions() -> None:
    robot = read(
        in_world(
            '<body name="a"><freejoint name="root"/><body name="b"><joint name="hip"/>'
            '<joint name="slide" type="slide"/><body name="c"><joint type="ball"/>'
            '<body name="d"><joint name="knee"/></body></body></body></body>',
            '<keyframe><key name="none"/><key qpos="1 2 3 1 0 0 0  0.4 0.5  1 0 0 0  0.6"/>'
            '<key qpos="0 0 0 1 0 0 0  0 0  1 0 0 0  0"/></keyframe>',
        )
    )
    assert robot.problems == ()
    assert robot.keyframe == {"hip": 0.4, "slide": 0.5, "knee": 0.6}


def test_excluded_pairs() -> None:
    assert read(EVERYTHING).excluded == frozenset({frozenset({"trunk", "leg"})})


def test_replicas_have_source_of_element() -> None:
    robot = read(EVERYTHING)
    lines = {link(robot, f"fin{k}").source.line for k in range(3)}
    assert len(lines) == 1
    assert '<body name="fin">' in EVERYTHING.splitlines()[lines.pop() - 1]


def test_sources_are_start_lines() -> None:
    text = in_world('\n<body\n name="a">\n<joint\n name="j" range="0 1"/><geom\n size="1"/></body>')
    robot = read(text)
    assert link(robot, "a").source.line == 2
    assert joint(robot, "j").source.line == 4
    assert link(robot, "a").collisions[0].source.line == 5
    assert link(robot, "a").collisions[0].source.element == 4


SCALED = """
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <frame pos="1 0 0" scale="2 2 2" {extra}>
      <body name="a" pos="1 0 0">
        <joint name="h" pos="0.1 0 0" range="-1 1" actuatorfrcrange="-1 1" damping="1"
          armature="1" frictionloss="5"/>
        <joint name="s" type="slide" ref="0.1" range="-1 1" actuatorfrcrange="-2 2" damping="3"
          armature="4" frictionloss="6"/>
        <inertial pos="1 1 1" mass="1" diaginertia="1 1 1"/>
        <geom type="box" size="1 2 3" pos="1 0 0"/>
        <body name="b" pos="0 1 0"><geom size="0.5"/>
          <frame pos="1 0 0" scale="0.5 0.5 0.5"><geom size="1" pos="1 1 0"/></frame></body>
      </body>
    </frame>
  </worldbody>
</mujoco>
"""


@pytest.mark.parametrize("extra", ["", 'scaling="geometry"', 'massscale="3"'])
def test_scaled_frames_match_mujoco(extra: str) -> None:
    if not hasattr(mujoco.MjSpec().worldbody.add_frame(), "scale"):
        pytest.skip(f"frames of MuJoCo {mujoco.__version__} have no scale")
    text = SCALED.format(extra=extra)
    robot = read(text)
    assert robot.problems == ()
    assert_compiled(robot, compiled(text))


@pytest.mark.parametrize(
    "compiler",
    [
        'inertiafromgeom="true"',
        'inertiagrouprange="0 1"',
        'settotalmass="7"',
        'boundmass="1.5" boundinertia="2"',
    ],
)
def test_masses_follow_compiler_settings(compiler: str) -> None:
    inside = """<body name="a"><freejoint/><inertial pos="1 0 0" mass="2" diaginertia="1 1 1"/>
      <geom size="1" mass="3"/><geom size="1" group="2" mass="4"/>
      <body name="b"><joint/><geom size="1" mass="5"/><geom size="2" group="3" mass="6"/></body>
      </body>"""
    text = in_world(inside, f"<compiler {compiler}/>")
    assert_compiled(read(text), compiled(text))


def test_geom_inertia_matches_mujoco() -> None:
    for shape in (
        'type="sphere" size="0.3"',
        'type="box" size="0.1 0.2 0.3"',
        'type="ellipsoid" size="0.1 0.2 0.3"',
        'type="cylinder" size="0.1 0.4"',
        'type="capsule" size="0.1 0.4"',
    ):
        text = in_world(
            f'<body name="a"><joint/><geom {shape} euler="20 30 40"/>'
            f'<geom {shape} pos="0.3 -0.2 0.5" mass="2"/></body>'
        )
        assert_compiled(read(text), compiled(text))


def test_shell_inertia_matches_mujoco() -> None:
    text = in_world(
        '<body name="a"><joint/><geom type="box" size="0.1 0.2 0.3" shellinertia="true"/></body>'
    )
    assert_compiled(read(text), compiled(text))


def test_mass_from_mesh_is_nan() -> None:
    robot = read(
        in_world(
            '<body name="a"><joint/><geom type="mesh" mesh="m"/></body>'
            '<body name="b"><joint/><geom type="mesh" mesh="m" mass="0"/></body>'
            '<body name="c"><joint/><geom type="mesh" mesh="m" mass="2"/></body>',
            '<asset><mesh name="m" file="m.stl"/></asset>',
        )
    )
    unknown, none, known = (link(robot, name).inertial for name in "abc")
    assert none is None
    assert unknown is not None
    assert unknown.mass is not None
    assert np.isnan(unknown.mass)
    assert known is not None
    assert known.mass == 2
    assert known.inertia is not None
    assert np.isnan(known.inertia).all()


def test_empty_body_has_no_inertial() -> None:
    assert link(read(in_world('<body name="a"/>')), "a").inertial is None


# Meshes


def box_stl(file: Path) -> Matrix:
    """Write a box that is nowhere symmetrical, as STL; returns its corners."""
    corners = np.array([[x, y, z] for x in (0.1, 0.5) for y in (0.2, 0.9) for z in (-0.3, 0.7)])
    faces = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)]
    faces += [(2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)]
    record = np.zeros(len(faces), dtype=[("n", "<3f4"), ("v", "<9f4"), ("a", "<u2")])
    record["v"] = [corners[list(face)].ravel() for face in faces]
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(b"\0" * 80 + np.uint32(len(faces)).tobytes() + record.tobytes())
    return corners


@pytest.mark.parametrize(
    "asset",
    [
        "",
        'scale="1 2 -3"',
        'scale="2 2 2" refpos="0.1 0.2 0.3" refquat="1 2 3 4"',
        'refpos="0.1 0.2 0.3" scale="1 2 3"',
    ],
)
def test_mesh_pose_matches_mujoco(asset: str, tmp_path: Path) -> None:
    file = tmp_path / "robot.xml"
    corners = box_stl(tmp_path / "parts" / "box.stl")
    file.write_text(
        in_world(
            '<body name="a"><joint/><frame pos="0 1 0" euler="0 0 30">'
            '<geom type="mesh" mesh="box" pos="0.3 0.2 0.1" quat="1 1 0 0.5"/></frame></body>',
            f'<compiler meshdir="parts"/><asset><mesh file="box.stl" {asset}/></asset>',
        )
    )
    (shape,) = link(load_robot(file), "a").collisions
    assert shape.mesh is not None
    assert shape.mesh.path == tmp_path / "parts" / "box.stl"
    assert shape.mesh.attribute == "file"
    assert shape.mesh.filename == "box.stl"
    ours = corners * shape.mesh.scale @ shape.origin[:3, :3].T + shape.origin[:3, 3]
    model = mujoco.MjModel.from_xml_path(str(file))
    at = pose(model.geom_pos[0], model.geom_quat[0])
    theirs = model.mesh_vert @ at[:3, :3].T + at[:3, 3]
    np.testing.assert_allclose(ours[order(ours)], theirs[order(theirs)], atol=1e-6)  # float32


def order(points: Matrix) -> Matrix:
    return np.lexsort(np.round(points, 4).T)


@pytest.mark.parametrize(
    ("compiler", "name", "path"),
    [
        ("", "box.stl", "box.stl"),
        ('meshdir="m"', "sub/box.stl", "m/sub/box.stl"),
        ('assetdir="m/"', "box.stl", "m/box.stl"),
        ('strippath="true" meshdir="m"', "somewhere/else/box.stl", "m/box.stl"),
    ],
)
def test_mesh_paths_follow_compiler_settings(
    compiler: str, name: str, path: str, tmp_path: Path
) -> None:
    file = tmp_path / "robot.xml"
    file.write_text(
        in_world(
            '<body name="a"><geom type="mesh" mesh="box"/></body>',
            f'<compiler {compiler}/><asset><mesh file="{name}" name="box"/></asset>',
        )
    )
    box_stl(tmp_path / path)
    (shape,) = link(load_robot(file), "a").collisions
    assert shape.mesh is not None
    assert shape.mesh.path == tmp_path / path
    mujoco.MjModel.from_xml_path(str(file))  # MuJoCo finds it there


def test_absolute_mesh_path_is_unchanged() -> None:
    robot = read(
        in_world(
            '<body name="a"><geom type="mesh" mesh="b"/></body>',
            '<compiler meshdir="m"/><asset><mesh file="/robots/b.stl"/></asset>',
        )
    )
    (shape,) = link(robot, "a").collisions
    assert shape.mesh is not None
    assert shape.mesh.path == Path("/robots/b.stl")


def test_inline_mesh_has_no_file() -> None:
    robot = read(
        in_world(
            '<body name="a"><geom type="mesh" mesh="m"/><geom type="box" mesh="f"/></body>',
            '<asset><mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/>'
            '<mesh name="f" file="f.stl"/></asset>',
        )
    )
    inline, fitted = link(robot, "a").collisions
    assert (inline.shape, inline.mesh, inline.fit_to_mesh) == ("unknown", None, False)
    assert fitted.fit_to_mesh
    assert fitted.mesh is not None


def test_geom_without_contacts_is_visual() -> None:
    robot = read(
        in_world(
            '<body name="a"><geom size="1" name="drawn" contype="0" conaffinity="0"/>'
            '<geom size="1" name="half" contype="0"/>'
            '<geom size="1" name="paired" contype="0" conaffinity="0"/></body>'
            '<body name="b"><geom size="1" name="other"/></body>',
            '<contact><pair geom1="paired" geom2="other"/></contact>',
        )
    )
    a = link(robot, "a")
    assert [shape.name for shape in a.visuals] == ["drawn"]
    assert not a.visuals[0].contacts
    assert [shape.name for shape in a.collisions] == ["half", "paired"]
    assert all(shape.contacts for shape in a.collisions)


def test_contacts_disabled_by_option() -> None:
    flag = '<option><flag contact="disable"/></option>'
    robot = read(in_world('<body name="a"><geom size="1"/></body>', flag))
    assert [shape.contacts for shape in link(robot, "a").collisions] == [False]


@pytest.mark.parametrize(
    ("attributes", "color"),
    [
        ("", None),
        ('rgba="0.5 0.5 0.5 1"', None),
        ('rgba="1 0 0 0.25"', (1, 0, 0, 0.25)),
        ('material="blue"', (0, 0, 1, 1)),
        ('material="blue" rgba="1 0 0 1"', (1, 0, 0, 1)),
        ('material="nothing"', None),
        ('class="painted"', (0, 0, 1, 1)),
        ('class="painted" rgba="0.5 0.5 0.5 1"', (0, 0, 1, 1)),
        ('class="red"', (1, 0, 0, 1)),
        ('material="new"', (1, 1, 1, 1)),
        ('rgba="2 0 0 1"', None),
        ('rgba="-1 0 0 1"', None),
    ],
)
def test_geom_color_or_material_color(attributes: str, color: tuple[float, ...] | None) -> None:
    rest = (
        '<default><default class="painted"><geom material="blue"/></default>'
        '<default class="red"><geom rgba="1 0 0 1"/></default></default>'
        '<asset><material name="blue" rgba="0 0 1 1"/><material name="new"/></asset>'
    )
    robot = read(in_world(f'<body name="b"><geom size="1" {attributes}/></body>', rest))
    assert link(robot, "b").collisions[0].color == color


# Joints and actuators


@pytest.mark.parametrize(
    ("attributes", "kind", "bounds"),
    [
        ('range="0.1 1"', "revolute", (0.1, 1)),
        ("", "continuous", None),
        ('range="0.1 1" limited="false"', "continuous", None),
        ('range="1 0.1"', "revolute", (1, 0.1)),
        ('range="0 0"', "revolute", (0, 0)),
        ('limited="true"', "revolute", (0, 0)),
        ('type="slide" range="0.1 1"', "prismatic", (0.1, 1)),
        ('type="slide"', "prismatic", None),
    ],
)
def test_joint_kind_and_limits(
    attributes: str, kind: str, bounds: tuple[float, float] | None
) -> None:
    text = in_world(
        f'<body name="a"><joint name="j" {attributes}/></body>', '<compiler angle="radian"/>'
    )
    it = joint(read(text), "j")
    assert it.kind == kind
    if bounds is None:
        assert it.limit is None
    else:
        assert it.limit is not None
        assert (it.limit.lower, it.limit.upper) == bounds


def test_range_without_limited_is_reported() -> None:
    robot = read(
        in_world('<body><joint name="j" range="0 1"/></body>', '<compiler autolimits="false"/>')
    )
    assert only(robot).code == "XML011"
    assert joint(robot, "j").kind == "revolute"


@pytest.mark.parametrize(
    ("joint_has", "drives", "effort"),
    [
        ('actuatorfrcrange="-5 7"', "", 7),
        ("", '<motor joint="j" ctrlrange="-2 2" gear="3"/>', 6),
        ("", '<motor joint="j" ctrlrange="-2 2" gear="-3" forcerange="-1 1"/>', 3),
        ("", '<motor joint="j"/>', None),
        ("", '<motor joint="j" ctrlrange="-2 2" ctrllimited="false"/>', None),
        ("", '<motor joint="j" ctrlrange="-2 2"/><motor joint="j" ctrlrange="-3 3"/>', 5),
        ("", '<motor joint="j" ctrlrange="-2 2"/><motor joint="j"/>', None),
        ('actuatorfrcrange="-5 5"', '<motor joint="j" ctrlrange="-2 2"/>', 2),
        ('actuatorfrcrange="-5 5"', '<motor joint="j"/>', 5),
        ("", '<position joint="j" kp="9" ctrlrange="-2 2"/>', None),
        ("", '<position joint="j" kp="9" ctrlrange="-2 2" forcerange="-8 8"/>', 8),
        ("", '<general joint="j" gainprm="4" ctrlrange="-2 2"/>', 8),
        ("", '<general joint="j" gainprm="4" ctrlrange="-2 2" dyntype="integrator"/>', None),
        ("", '<velocity joint="j" kv="9" ctrlrange="-2 2"/>', None),
        ("", '<motor joint="j" ctrlrange="-inf inf" forcerange="-4 4"/>', 4),
    ],
)
def test_actuator_effort(joint_has: str, drives: str, effort: float | None) -> None:
    robot = read(
        in_world(
            f'<body name="a"><joint name="j" {joint_has}/></body>',
            f"<actuator>{drives}</actuator>",
        )
    )
    limit = joint(robot, "j").limit
    assert (limit and limit.effort) == effort
    assert robot.problems == ()


def test_actuators_have_joint() -> None:
    robot = read(
        in_world(
            '<body name="a"><joint name="j"/><site name="s"/></body>',
            '<actuator><motor name="m" joint="j" ctrlrange="-1 1"/><general site="s"/>'
            '<plugin plugin="some.plugin" joint="j" ctrlrange="-1 1"/></actuator>',
        )
    )
    assert [each.joint for each in robot.actuators] == ["j", "", "j"]
    assert [each.effort for each in robot.actuators] == [1, None, None]


def test_actuator_armature_adds_to_joint() -> None:
    text = in_world(
        '<body name="a"><joint name="j" armature="0.5"/><geom size="1"/></body>',
        '<actuator><motor joint="j" armature="0.1" gear="3"/></actuator>',
    )
    robot = read(text)
    if robot.problems:
        pytest.skip(f"motors of MuJoCo {mujoco.__version__} have no armature")
    assert joint(robot, "j").armature == pytest.approx(0.5 + 0.1 * 9)


def test_joint_equality_becomes_mimic() -> None:
    robot = read(
        in_world(
            '<body name="a"><joint name="j" ref="0.2"/><body name="b"><joint name="k" ref="0.1"/>'
            '<body name="c"><joint name="l"/></body></body></body>',
            '<compiler angle="radian"/><equality><joint joint1="k" joint2="j" polycoef="0.5 2"/>'
            '<joint joint1="l" joint2="j" polycoef="0 1 1"/></equality>',
        )
    )
    mimic = joint(robot, "k").mimic
    assert mimic is not None
    assert mimic.joint == "j"
    assert mimic.multiplier == 2
    assert mimic.offset == pytest.approx(0.5 + 0.1 - 2 * 0.2)
    assert joint(robot, "l").mimic is None  # not in proportion


def test_unnamed_elements_get_names() -> None:
    robot = read(in_world("<body><freejoint/><body><joint/><joint/></body><body/></body>"))
    names = [each.name for each in robot.links if not each.virtual]
    assert len(set(names)) == 3
    joints = [each.name for each in robot.joints]
    assert len(set(joints)) == 4
    assert all(name.replace("_", "").isalnum() for name in (*names, *joints))


# Includes and attached models


def write_all(folder: Path, files: Mapping[str, str]) -> Path:
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder / "robot.xml"


def test_included_elements_have_file_and_line(tmp_path: Path) -> None:
    file = write_all(
        tmp_path,
        {
            "robot.xml": '<mujoco>\n<include file="parts/defaults.xml"/>\n<worldbody>\n'
            '<body name="a"><include file="parts/leg.xml"/></body>\n</worldbody></mujoco>',
            "parts/defaults.xml": "<mujocoinclude><default><joint\n damping='2'/></default>"
            "</mujocoinclude>",
            "parts/leg.xml": '<mujoco>\n<body name="leg">\n<joint name="j"/>'
            '<include file="parts/foot.xml"/></body></mujoco>',
            "parts/foot.xml": '<x>\n\n<geom name="foot" size="1"/></x>',
        },
    )
    robot = load_robot(file)
    assert robot.problems == ()
    assert link(robot, "a").source.line == 4
    assert link(robot, "leg").source.file == tmp_path / "parts" / "leg.xml"
    assert joint(robot, "j").source.line == 3
    assert joint(robot, "j").damping == 2
    (foot,) = link(robot, "leg").collisions
    assert (foot.source.file.name, foot.source.line, foot.source.element) == ("foot.xml", 3, 1)
    assert [path.name for path in robot.sources] == [
        "robot.xml",
        "defaults.xml",
        "leg.xml",
        "foot.xml",
    ]
    mujoco.MjSpec.from_file(str(file))  # so does MuJoCo


def test_include_relative_to_including_file(tmp_path: Path) -> None:
    file = write_all(
        tmp_path,
        {
            "robot.xml": '<mujoco><include file="sub/a.xml"/></mujoco>',
            "sub/a.xml": '<x><include file="b.xml"/></x>',
            "sub/b.xml": '<x><worldbody><body name="beside"/></worldbody></x>',
        },
    )
    assert link(load_robot(file), "beside").source.file == tmp_path / "sub" / "b.xml"
    (tmp_path / "b.xml").write_text('<x><worldbody><body name="top"/></worldbody></x>')
    assert [each.name for each in load_robot(file).links] == ["top"]
    assert [each.name for each in mujoco.MjSpec.from_file(str(file)).bodies] == ["world", "top"]


@pytest.mark.parametrize(
    ("include", "says"),
    [
        ('<include file="gone.xml"/>', "there is no file"),
        ("<include/>", "no file"),
        ('<include file="robot.xml"/>', "included by itself"),
        ('<include file="circle.xml"/>', "included by itself"),
        ('<include file="part.xml"/><include file="./part.xml"/>', "included twice"),
        ('<include file="empty.xml"/>', "is empty"),
        ('<include file="."/>', "folder"),
        ('<include file="part.xml"><body/></include>', "children"),
    ],
)
def test_broken_includes_are_reported(include: str, says: str, tmp_path: Path) -> None:
    file = write_all(
        tmp_path,
        {
            "robot.xml": f'<mujoco>\n{include}<worldbody><body name="a"/></worldbody></mujoco>',
            "part.xml": '<x><worldbody><body name="b"/></worldbody></x>',
            "circle.xml": '<x><include file="circle.xml"/></x>',
            "empty.xml": "<x/>",
        },
    )
    robot = load_robot(file)
    problem = only(robot)
    assert problem.code == "XML012"
    assert says in problem.message
    assert problem.source.line in (1, 2)
    assert link(robot, "a")


def test_errors_in_included_file_name_the_file(tmp_path: Path) -> None:
    file = write_all(
        tmp_path,
        {
            "robot.xml": '<mujoco><include file="part.xml"/></mujoco>',
            "part.xml": '<x>\n<worldbody><body name="b" poss="1 2 3"/></worldbody></x>',
        },
    )
    problem = only(load_robot(file))
    assert problem.code == "XML007"
    assert (problem.source.file.name, problem.source.line) == ("part.xml", 2)


def test_contents_replace_files(tmp_path: Path) -> None:
    file = tmp_path / "robot.xml"
    data = b'<mujoco><include file="part.xml"/></mujoco>'
    part = b'<x><worldbody><body name="b"/></worldbody></x>'
    robot = load_robot(file, contents={file: data, tmp_path / "part.xml": part})
    assert [each.name for each in robot.links] == ["b"]


def test_attached_model_keeps_its_settings(tmp_path: Path) -> None:
    file = write_all(
        tmp_path,
        {
            "robot.xml": '<mujoco><compiler angle="radian"/><asset><model name="h" '
            'file="sub/hand.xml"/></asset><worldbody><body name="arm"><frame pos="0 0 1">'
            '<attach model="h" body="hand" prefix="l_"/></frame></body></worldbody></mujoco>',
            "sub/hand.xml": '<mujoco><compiler angle="degree" meshdir="m"/><asset>'
            '<mesh name="b" file="b.stl"/></asset><worldbody>\n<body name="hand">\n'
            '<joint name="j" range="-90 90"/><geom type="mesh" mesh="b"/></body></worldbody>'
            "</mujoco>",
        },
    )
    box_stl(tmp_path / "sub" / "m" / "b.stl")
    robot = load_robot(file)
    assert robot.problems == ()
    hand = link(robot, "l_hand")
    assert (hand.source.file.name, hand.source.line) == ("hand.xml", 2)
    limit = joint(robot, "l_j").limit
    assert limit is not None
    assert limit.upper == pytest.approx(np.pi / 2)
    (shape,) = hand.collisions
    assert shape.mesh is not None
    assert shape.mesh.path == tmp_path / "sub" / "m" / "b.stl"
    same_pose(joint(robot, "l_j").origin, pose(np.array([0, 0, 1.0]), np.array([1.0, 0, 0, 0])))
    mujoco.MjModel.from_xml_path(str(file))


@pytest.mark.parametrize("model", ["gone.xml", "robot.xml", "robot.urdf"])
def test_invalid_attachments_are_reported(model: str, tmp_path: Path) -> None:
    file = write_all(
        tmp_path,
        {
            "robot.xml": f'<mujoco><asset><model name="h" file="{model}"/></asset><worldbody>'
            '<body name="arm"><attach model="h" body="hand" prefix="l_"/></body></worldbody>'
            "</mujoco>",
            "robot.urdf": "<robot name='r'/>",
        },
    )
    robot = load_robot(file)
    assert codes(robot)[0] == "XML012"
    assert link(robot, "arm")


# What MuJoCo refuses


def test_all_defects_are_reported() -> None:
    text = in_world(
        '\n<body name="a" poss="1 2 3"><inertial pos="0 0 0" mass="1,5" diaginertia="1 1 1"/>'
        '\n<joint name="j" range="0 1 2"/><joint name="j"/><geom size="0.1" type="ball"/></body>'
        '\n<bodi name="a"><geom size="nan"/></bodi>',
        '<actuator><motor joint="j" gain="1"/><motr joint="j"/></actuator>',
    )
    robot = read(text)
    told = {(p.code, p.source.line): p for p in robot.problems}
    assert set(told) == {
        ("XML007", 1),
        ("XML007", 2),
        ("XML006", 2),
        ("XML006", 3),
        ("TRE001", 3),
        ("XML011", 3),
        ("XML007", 4),
        ("XML006", 4),
        ("TRE001", 4),
    }
    inertial = link(robot, "a").inertial
    assert inertial is not None
    assert inertial.mass == 1.5
    assert told["XML006", 2].details["repaired"] == "1.5"
    assert told["XML006", 2].subject == "a"
    assert [each.name for each in robot.links] == ["a:j", "a", "a_2"]
    assert [each.joint for each in robot.actuators] == ["j", "j"]


@pytest.mark.parametrize(
    ("text", "code", "says"),
    [
        (in_world('<body name="a" pos="1 2"/>'), "XML006", "'1 2'; expected 3 numbers"),
        (in_world('<body name="a" pos="1 2 3 4"/>'), "XML006", "expected 3 numbers"),
        (in_world('<body name="a" pos="nan 0 0"/>'), "XML006", "'nan 0 0'"),
        (in_world('<body name="a" pos="inf 0 0"/>'), "XML006", "'inf 0 0'"),
        (in_world('<body name="a" pos="1e308 0 0"/>'), "XML006", "'1e308 0 0'"),
        (in_world('<body name="a" pos="x 0 0"/>'), "XML006", "'x 0 0'"),
        (in_world('<body name="a"><geom size="1" contype="1.5"/></body>'), "XML006", "'1.5'"),
        (in_world('<body name="a"><geom sise="1"/></body>'), "XML007", "did you mean size?"),
        (in_world('<body name="a"><geom strange="1"/></body>'), "XML007", "strange of <geom>"),
        (in_world('<body name="a"><gem size="1"/></body>'), "XML007", "did you mean <geom>?"),
        ("<mujoco><strange/></mujoco>", "XML007", "<strange> in <mujoco>"),
        (in_world('<body name="a"/><body name="a"/>'), "TRE001", "duplicate body a"),
        (in_world('<body><joint name="j"/><joint name="j"/></body>'), "TRE001", "joint j"),
        (in_world('<body name="world"/>'), "TRE001", "world"),
        (in_world('<geom size="1" name="g"/><geom size="1" name="g"/>'), "XML011", "'g' in geom"),
        (in_world('<body name="a"><geom type="ball"/></body>'), "XML011", "'ball' in type"),
        (in_world('<body name="a"><geom class="no"/></body>'), "XML011", "'no' in class"),
        (in_world('<body name="a" childclass="no"/>'), "XML011", "childclass 'no'"),
        (in_world('<body name="a" quat="0 0 0 0"/>'), "XML011", "zero quaternion"),
        (in_world('<body name="a" quat="1 0 0 0" euler="0 0 0"/>'), "XML011", "multiple"),
        (in_world('<body name="a" axisangle="0 0 0 1"/>'), "XML011", "axisangle too small"),
        (in_world('<body euler="1 2 3"/>', '<compiler eulerseq="xyq"/>'), "XML011", "sequence"),
        (in_world('<joint name="j"/>'), "XML011", "World body"),
        (
            in_world('<body><geom size="1" type="capsule" fromto="1 1 1 1 1 1"/></body>'),
            "XML011",
            "fromto",
        ),
        (
            in_world('<body name="a"><inertial mass="1" diaginertia="1 1 1"/></body>'),
            "XML013",
            "<inertial> has no pos",
        ),
        (
            in_world(
                '<body name="a"><inertial pos="0 0 0" mass="1"/>'
                '<inertial pos="0 0 0" mass="1"/></body>'
            ),
            "XML011",
            "found 2 times",
        ),
        (in_world('<body><geom type="mesh" mesh="no"/></body>'), "XML011", "'no'"),
        (
            in_world("<body/>", '<actuator><motor joint="no"/></actuator>'),
            "XML011",
            "expected the name of a joint",
        ),
        (
            in_world("<body/>", '<contact><exclude body1="world" body2="no"/></contact>'),
            "XML011",
            "'no'",
        ),
        (
            in_world("<body><joint/></body>", '<keyframe><key qpos="1 2"/></keyframe>'),
            "XML011",
            "got 2 numbers; expected 1",
        ),
        ("<mujoco><compiler angle='grad'/></mujoco>", "XML011", "'grad' in angle"),
        ("<mujocoinclude/>", "XML002", "mujocoinclude"),
    ],
)
def test_defects_have_codes(text: str, code: str, says: str) -> None:
    problem = only(read(text))
    assert problem.code == code
    assert says in problem.message
    assert "\n" not in problem.message
    assert problem.source.line == 1


@pytest.mark.parametrize("scale", ["2 3 4", "-1 1 1", "0 1 1"])
def test_frame_scale_that_is_not_uniform_is_reported(scale: str) -> None:
    if not hasattr(mujoco.MjSpec().worldbody.add_frame(), "scale"):
        pytest.skip(f"frames of MuJoCo {mujoco.__version__} have no scale")
    robot = read(in_world(f'<frame scale="{scale}"><body name="a"><geom size="1"/></body></frame>'))
    assert "expected equal positive factors" in only(robot).message
    assert link(robot, "a").collisions[0].shape == "sphere"


def test_invalid_geoms_keep_their_values() -> None:
    robot = read(
        in_world(
            '<body name="a"><geom size="-1"/><geom size="1" mass="-2"/>'
            '<geom type="capsule" size="0.1 0" pos="1 2 3"/></body>'
            '<body name="b"><geom size="1" mass="3"/></body>'
        )
    )
    assert robot.problems == ()
    inertial, valid = (link(robot, name).inertial for name in "ab")
    assert [shape.size for shape in link(robot, "a").collisions] == [(-1,), (1,), (0.1, 0)]
    assert link(robot, "a").collisions[2].origin[:3, 3].tolist() == [1, 2, 3]
    assert inertial is not None
    assert inertial.mass == -2
    assert valid is not None
    assert valid.mass == 3


def test_everything_mujoco_rejects_is_reported() -> None:
    """Every text of the test above that MuJoCo takes is one that its compiler refuses."""
    for text in (
        in_world('<body name="a"><geom sise="1"/></body>'),
        in_world('<body name="a"><geom type="mesh" mesh="no"/></body>'),
        in_world("<body><joint/></body>", '<keyframe><key qpos="1 2"/></keyframe>'),
        in_world("", '<actuator><motor joint="no"/></actuator>'),
    ):
        with pytest.raises(ValueError, match="Error"):
            mujoco.MjModel.from_xml_string(text)


def test_part_of_scene_may_refer_elsewhere() -> None:
    foot = '<body name="a"><geom name="foot" size="1"/></body>'
    pair = '<contact><pair geom1="foot" geom2="floor"/></contact>'
    assert read(in_world(foot, pair)).problems == ()
    assert read(f"<mujoco>{pair}</mujoco>").problems == ()
    ground = '<geom name="ground" type="plane" size="1 1 1"/>'
    assert "'floor'" in only(read(in_world(foot + ground, pair))).message


def test_missing_mass_is_left_to_lint_rule() -> None:
    robot = read(in_world('<body name="a"><inertial pos="0 0 0" diaginertia="1 1 1"/></body>'))
    inertial = link(robot, "a").inertial
    assert robot.problems == ()
    assert inertial is not None
    assert inertial.mass is None
    assert inertial.inertia is not None


def test_inertial_without_inertia() -> None:
    robot = read(in_world('<body name="a"><inertial pos="0 0 0" mass="-1"/></body>'))
    inertial = link(robot, "a").inertial
    assert inertial is not None
    assert inertial.mass == -1  # stays what it is
    assert inertial.inertia is None


def test_repeated_error_is_reported_once() -> None:
    robot = read(in_world("".join(f'\n<body name="b{k}" poss="1 2 3"/>' for k in range(300))))
    problem = only(robot)
    assert "300 times, next on line 3" in problem.message
    assert len(robot.links) == 300
    assert joint(robot, "b7_fixed").origin[:3, 3].tolist() == [1, 2, 3]


def test_decimal_commas_are_all_reported() -> None:
    robot = read(in_world("".join(f'\n<body name="b{k}" pos="0,1 2 3"/>' for k in range(100))))
    assert codes(robot) == ["XML006"] * 100
    assert joint(robot, "b7_fixed").origin[:3, 3].tolist() == [0.1, 2, 3]


def test_renamed_top_level_default() -> None:
    robot = read(
        in_world(
            '<body name="a" childclass="old"><joint name="j"/></body>',
            '<default class="old"><joint damping="3"/></default>',
        )
    )
    assert only(robot).code == "XML011"
    assert joint(robot, "j").damping == 3


# Bounds


@pytest.mark.parametrize(
    "text",
    [
        in_world('<replicate count="1000000000"><body name="a"/></replicate>'),
        in_world('<replicate count="300">' * 5 + '<body name="a"/>' + "</replicate>" * 5),
        in_world(f'<body name="a"><geom size="1" user="{"1 " * 100000}"/></body>'),
        in_world(
            '<body name="a"/>',
            '<asset><hfield name="h" nrow="100000" ncol="100000" size="1 1 1 1"/></asset>',
        ),
        in_world(
            '<body name="a"/>',
            '<asset><mesh name="m" builtin="supersphere" params="100000 1 1"/></asset>',
        ),
        in_world(
            '<body name="a"/>',
            "<custom>"
            + "".join(f'<numeric name="n{k}" size="500000" data="1"/>' for k in range(1000))
            + "</custom>",
        ),
        in_world('<body name="a"/><flexcomp name="f" type="grid" count="1000 1000 1000"/>'),
    ],
)
def test_memory_is_bounded(text: str) -> None:
    robot = read(text)
    assert "a" in [each.name.rstrip("0") for each in robot.links]


def test_long_chain_of_joints_is_compiled_without_them() -> None:
    """MuJoCo's compiler needs minutes for these 4,600 degrees of freedom."""
    joints = "<joint/>" * 20
    began = time.process_time()
    robot = read(in_world(f"<body>{joints}" * 230 + "</body>" * 230))
    assert time.process_time() - began < 20
    assert robot.problems == ()
    assert len(robot.joints) == 4600


def test_too_many_elements_are_reported() -> None:
    robot = read(in_world("<body/>" * (MAX_ELEMENTS + 1)))
    assert only(robot).code == "XML011"
    assert robot.links == ()


def test_nested_attachments_are_bounded(tmp_path: Path) -> None:
    files = {}
    for k in range(30):
        twice = "".join(f'<attach model="m" body="b" prefix="p{k}_"/>' for k in range(2))
        files["robot.xml" if k == 0 else f"m{k}.xml"] = in_world(
            f'<body name="b">{twice}</body>',
            f'<asset><model name="m" file="m{k + 1}.xml"/></asset>',
        )
    files["m30.xml"] = in_world('<body name="b"/>')
    file = write_all(tmp_path, files)
    robot = load_robot(file)
    assert codes(robot) == ["XML011"]


def test_deep_chain_is_read_to_limit() -> None:
    robot = read(in_world("<body>" * 10_000 + "</body>" * 10_000))
    assert "XML001" in codes(robot)
    robot = read(in_world("<body>" * 200 + "</body>" * 200))
    assert robot.problems == ()
    assert len(robot.links) == 200


def test_deeply_nested_includes(tmp_path: Path) -> None:
    inner = '<x>{}<include file="p{}.xml"/>{}</x>'
    files = {"robot.xml": in_world('<include file="p0.xml"/>')}
    for k in range(100):
        files[f"p{k}.xml"] = inner.format("<body>" * 100, k + 1, "</body>" * 100)
    robot = load_robot(write_all(tmp_path, files))
    assert codes(robot) == ["XML011"]
    assert "deep" in robot.problems[0].message
    assert len(robot.links) > 200


def test_no_log_file_and_no_warnings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    read(
        in_world(
            '<body name="a" pos="nan 0 0"><geom size="1" friction="nan" solref="nan 1"/>'
            '<site rgba="nan 0 0 0"/></body>',
            '<visual><map fogend="nan"/></visual>',
        )
    )
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")
    assert mujoco.get_mju_user_warning() is None


def test_broken_input_raises_nothing() -> None:
    """Bytes are dropped, doubled and swapped at random; the reader always returns."""
    rng = random.Random(0)
    whole = EVERYTHING.encode()
    pieces = [
        b"<",
        b">",
        b"/",
        b'"',
        b"nan",
        b"-1",
        b"1e308",
        b"<body>",
        b"</body>",
        b"\0",
        b"\xff",
    ]
    pieces += [b" ", b"0", b"=", b'<include file="robot.xml"/>', b"name", b"world", b"class"]
    for _ in range(25):
        data = bytearray(whole)
        for _ in range(rng.randint(1, 12)):
            at = rng.randrange(len(data))
            match rng.randrange(3):
                case 0:
                    del data[at : at + rng.randint(1, 20)]
                case 1:
                    data[at:at] = rng.choice(pieces)
                case 2:
                    data[at:at] = data[at : at + rng.randint(1, 60)]
        assert isinstance(read(bytes(data)), RobotModel)


def test_any_attribute_value_raises_nothing() -> None:
    """Values are swapped between attributes at random."""
    rng = random.Random(1)
    values = re.findall(r'="([^"]*)"', EVERYTHING)
    values += ["", "nan", "-1", "1e308", "0 0 0", "1 2 3 4 5 6 7", "true", "&#10;", "&lt;", "ä"]
    for _ in range(25):
        pieces = re.split(r'(?<==)"[^"]*"', EVERYTHING)
        own = re.findall(r'(?<==)"[^"]*"', EVERYTHING)
        for k in rng.sample(range(len(own)), rng.randint(1, 10)):
            own[k] = f'"{rng.choice(values)}"'
        robot = read("".join(a + b for a, b in zip(pieces, [*own, ""], strict=True)))
        assert isinstance(robot, RobotModel)
        for each in robot.joints:
            assert each.origin.shape == (4, 4)


def test_document_without_root_keeps_problems() -> None:
    robot = read("")
    assert robot.kind == "mjcf"
    assert codes(robot) == ["XML001"]


def test_geometry_is_typed() -> None:
    robot = read(
        in_world(
            '<body name="a"><geom type="hfield" hfield="h"/></body>',
            '<asset><hfield name="h" file="h.png" size="1 1 1 1"/></asset>',
        )
    )
    (shape,) = link(robot, "a").collisions
    assert isinstance(shape, Geometry)
    assert shape.shape == "unknown"


# The IMU


def imu_robot(sensors: str, *, base: str = "", arm: str = "", world: str = "") -> RobotModel:
    return read(
        f"""<mujoco><worldbody>{world}<body name="base"><geom size="1"/>
          <body name="arm"><joint/><geom size="1"/>{arm}</body>{base}</body></worldbody>
          <sensor>{sensors}</sensor></mujoco>"""
    )


def test_imu_is_site_of_gyro() -> None:
    robot = imu_robot(
        '<gyro site="here"/>',
        base='<site name="imu"/>',
        arm='<site name="here" pos="1 2 3" euler="0 0 90"/>',
    )
    assert robot.problems == ()
    assert robot.imu is not None
    assert robot.imu[0] == "arm"
    wanted = [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]
    np.testing.assert_allclose(robot.imu[1], wanted, atol=1e-12)


@pytest.mark.parametrize("sensor", ["gyro", "accelerometer"])
def test_imu_closest_to_base_is_used(sensor: str) -> None:
    robot = imu_robot(
        f'<{sensor} site="far"/><{sensor} site="near"/>',
        arm='<site name="far"/>',
        base='<site name="near"/>',
    )
    assert robot.imu is not None
    assert robot.imu[0] == "base"


def test_imu_site_by_name() -> None:
    robot = imu_robot('<framequat objtype="site" objname="other"/>', arm='<site name="IMU"/>')
    assert robot.imu is not None
    assert robot.imu[0] == "arm"


def test_site_poses_match_mujoco() -> None:
    inside = '<frame pos="1 0 0" euler="0 90 0"><site name="imu" {}/></frame>'
    for written in ('pos="0 0 1" euler="30 0 0"', 'type="capsule" size="1" fromto="0 0 1 1 0 2"'):
        text = in_world(f'<body name="base"><geom size="1"/>{inside.format(written)}</body>')
        robot, model = read(text), compiled(text)
        assert robot.imu is not None
        same_pose(robot.imu[1], pose(model.site_pos[0], model.site_quat[0]))


@pytest.mark.parametrize(
    "robot",
    [
        imu_robot(""),
        imu_robot("", world='<site name="imu"/>'),  # of the world, on no body
        imu_robot('<gyro site="nowhere"/>'),
    ],
)
def test_no_imu(robot: RobotModel) -> None:
    assert robot.imu is None


def test_invalid_site_orientation_is_reported() -> None:
    robot = imu_robot("", base='<site name="imu" axisangle="0 0 0 1"/>')
    assert [problem.code for problem in robot.problems] == ["XML011"]
