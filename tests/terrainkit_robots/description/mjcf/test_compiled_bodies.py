"""Poses, inertias, joints and shapes are those that MuJoCo compiles."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.transforms import quat_to_matrix
from tests.tables import read_table
from tests.terrainkit_robots.description.made_robots import body, codes, link, mjcf, read

EXACT = 1e-9 if int(mujoco.__version__.split(".")[0]) > 3 else 1e-6
"""MuJoCo 3 finds the principal axes of an inertia less exactly."""

NO_SCALE = not hasattr(mujoco.MjSpec().worldbody.add_frame(), "scale")
needs_scale = pytest.mark.skipif(NO_SCALE, reason="frames of MuJoCo before 3.16 have no scale")

EVERYTHING = Path(__file__).with_name("everything.xml").read_text()
SCALED = Path(__file__).with_name("scaled.xml").read_text()


def compiled(text):
    with quiet_mujoco():
        return mujoco.MjModel.from_xml_string(text)


def pose(pos, quat):
    whole = np.eye(4)
    whole[:3, :3], whole[:3, 3] = quat_to_matrix(quat), pos
    return whole


def same(ours, theirs):
    np.testing.assert_allclose(ours, theirs, atol=EXACT)


def assert_compiled(text):
    """Compare everything that the compiler has with the robot."""
    robot, model = read(text), compiled(text)
    assert robot.problems == ()
    links = [each for each in robot.links if not each.virtual]
    assert [each.name for each in links] == [model.body(k).name for k in range(1, model.nbody)]
    virtual = {each.name for each in robot.links if each.virtual}
    above = {each.child: each for each in robot.joints}
    for k, each in enumerate(links, 1):
        first = above[each.name]
        while first.parent in virtual:
            first = above[first.parent]
        assert first.parent == model.body(model.body_parentid[k]).name
        same(first.origin, pose(model.body_pos[k], model.body_quat[k]))
        assert_inertia(each.inertial, model, k)
        assert_shapes(each, model, np.flatnonzero(model.geom_bodyid == k))
    moving = [each for each in robot.joints if each.kind != "fixed"]
    for each, k in zip(moving, range(model.njnt), strict=True):
        assert_joint(each, model, k)


def assert_inertia(inertial, model, k):
    if inertial is None:
        assert model.body_mass[k] == 0
        return
    ours, theirs = inertial.origin, pose(model.body_ipos[k], model.body_iquat[k])
    same(inertial.mass, model.body_mass[k])
    same(ours[:3, 3], theirs[:3, 3])
    same(
        ours[:3, :3] @ inertial.inertia @ ours[:3, :3].T,
        theirs[:3, :3] @ np.diag(model.body_inertia[k]) @ theirs[:3, :3].T,
    )


def assert_shapes(link, model, geoms):
    shapes = sorted((*link.collisions, *link.visuals), key=lambda shape: shape.source.line)
    for shape, g in zip(shapes, geoms, strict=True):
        same(shape.origin, pose(model.geom_pos[g], model.geom_quat[g]))
        same(shape.size, model.geom_size[g][: len(shape.size)])


def assert_joint(joint, model, k):
    dof, free = model.jnt_dofadr[k], {0: "floating", 1: "ball"}.get(model.jnt_type[k])
    if free:
        assert joint.kind == free
        return
    same(joint.direction, model.jnt_axis[k])
    same(joint.anchor, model.jnt_pos[k])
    same(joint.reference, model.qpos0[model.jnt_qposadr[k]])
    same(joint.damping, model.dof_damping.reshape(model.nv, -1)[dof, 0])
    same(joint.armature, model.dof_armature[dof])
    same(joint.friction, model.dof_frictionloss[dof])
    if model.jnt_limited[k]:
        same((joint.limit.lower, joint.limit.upper), model.jnt_range[k])
    if model.jnt_actfrclimited[k]:
        same(joint.effort, abs(model.jnt_actfrcrange[k]).max())


def test_model_matches_mujoco():
    assert_compiled(EVERYTHING)


@needs_scale
@pytest.mark.parametrize("extra", ["", 'scaling="geometry"', 'massscale="3"'])
def test_scaled_frames_match_mujoco(extra):
    assert_compiled(SCALED.format(extra=extra))


@needs_scale
@pytest.mark.parametrize(
    ("scale", "mean"), [("8 1 1", 2), ("2 2 16", 4), ("-8 1 1", 2), ("-3 -3 -3", 3), ("0 1 1", 1)]
)
def test_frame_scale_that_is_not_uniform_is_replaced_by_its_mean(scale, mean):
    robot = read(mjcf(f'<frame scale="{scale}"><body name="a"><geom size="1"/></body></frame>'))
    (problem,) = robot.problems
    assert problem.message == (
        f"scale of <frame>: got {scale}; expected equal positive factors; {mean} is used for all "
        "axes"
    )
    assert link(robot).collisions[0].size == pytest.approx((mean,))


@pytest.mark.parametrize("compiler", read_table(__file__, "masses_follow_compiler_settings"))
def test_masses_follow_compiler_settings(compiler):
    """Body b has no inertial of its own; of a, MuJoCo may use either."""
    inside = """<freejoint/><inertial pos="1 0 0" mass="2" diaginertia="1 1 1"/>
      <geom size="1" mass="3"/><geom size="1" group="2" mass="4"/>
      <body name="b"><geom size="1" mass="5"/><geom size="2" group="3" mass="6"/></body>"""
    assert_compiled(body(inside, f"<compiler {compiler}/>"))


@pytest.mark.parametrize("shape", read_table(__file__, "geom_inertia_matches_mujoco"))
def test_geom_inertia_matches_mujoco(shape):
    turned = f'<geom {shape} euler="20 30 40"/>'
    assert_compiled(body(f'<joint/>{turned}<geom {shape} pos="0.3 -0.2 0.5" mass="2"/>'))


def test_mass_from_mesh_is_nan():
    mesh = '<body name="{}"><joint/><geom type="mesh" mesh="m"{}/></body>'
    inside = mesh.format("a", "") + mesh.format("b", ' mass="0"') + mesh.format("c", ' mass="2"')
    robot = read(mjcf(inside, '<asset><mesh name="m" file="m.stl"/></asset>'))
    unknown, none, known = (link(robot, name).inertial for name in "abc")
    assert np.isnan(unknown.mass)
    assert none is None
    assert known.mass == 2
    assert np.isnan(known.inertia).all()


def test_geoms_without_density_give_no_inertial():
    assert link(read(body(""))).inertial is None
    assert link(read(body('<geom size="1" density="0"/>'))).inertial is None
    assert link(read(body('<geom size="1" density="0" mass="2"/>'))).inertial.mass == 2
    assert np.isnan(link(read(body('<geom size="1" density="-1"/>'))).inertial.mass)  # unknown


def test_invalid_geoms_keep_their_values():
    """Their masses are not compiled: the first has no valid size, and the second is negative."""
    robot = read(
        body(
            '<geom size="-1" mass="5"/><geom size="1" mass="-2"/><geom size="1" mass="3"/>'
            '<geom type="capsule" size="0.1 0" pos="1 2 3"/>'
        )
    )
    assert robot.problems == ()
    shapes = link(robot).collisions
    assert [shape.size for shape in shapes] == [(-1,), (1,), (1,), (0.1, 0)]
    assert shapes[3].origin[:3, 3].tolist() == [1, 2, 3]
    assert link(robot).inertial.mass == pytest.approx(1)


@pytest.mark.parametrize(("inside", "says"), read_table(__file__, "invalid_orientations"))
def test_invalid_orientations_are_reported(inside, says):
    robot = read(body(inside))
    assert codes(robot) == ["XML011"]
    assert robot.problems[0].message.startswith(says)


def test_long_chain_of_joints_is_compiled_without_them():
    """MuJoCo's compiler would need minutes for these 4,600 degrees of freedom."""
    joints = "<joint/>" * 20
    robot = read(mjcf(f"<body>{joints}" * 230 + "</body>" * 230))
    assert (robot.problems, len(robot.joints)) == ((), 4600)
