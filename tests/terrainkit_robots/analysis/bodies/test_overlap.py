import math

import mujoco
import numpy as np
import pytest
import trimesh

from terrainkit_robots.analysis.bodies import overlap
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from tests.small_robots import ball, box, facts, joint, link, shape

BOX = box("0.2 0.2 0.2")


def spin(parent, child, xyz="0 0 0", **changed):
    return joint(parent, child, xyz, kind="continuous", axis="0 0 1", **changed)


def apart(first, second, xyz, rpy="0 0 0"):
    """Return a scene of two shapes with an empty body between them, so that they can collide."""
    bodies = [link("a", first, mass=None), link("b", mass=None), link("c", second, mass=None)]
    return facts(*bodies, spin("a", "b"), spin("b", "c", xyz, rpy=rpy)).overlap_scene


def depths(scene, positions=None):
    return pytest.approx([found.depth for found in scene.detect(positions or {})], abs=1e-5)


@pytest.mark.parametrize(
    ("first", "second", "xyz", "expected"),
    [
        # Spheres of 0.1 and 0.2 m, 0.25 m apart.
        (ball(0.1), ball(0.2), "0 0.25 0", [0.05]),
        (ball(0.1), ball(0.2), "0 0.31 0", []),
        # Boxes with half sides of 0.1 m, 0.15 m apart along x; the other sides are aligned.
        (BOX, BOX, "0.15 0 0", [0.05]),
        (BOX, BOX, "0.15 0.18 0", [0.02]),
        (BOX, BOX, "0.201 0 0", []),
        (BOX, ball(0.1), "0 0 0.17", [0.03]),
        # A capsule from z = -0.3 to 0.3 with a radius of 0.05 above a box.
        (BOX, shape('capsule radius="0.05" length="0.6"'), "0.13 0 0", [0.02]),
        (BOX, shape('cylinder radius="0.05" length="0.6"'), "0 0 0.38", [0.02]),
        # The shapes are 1.15 - 1 m and 1 - 1 m apart.
        (box("0.2 0.2 0.2", "1 0 0"), box("0.2 0.2 0.2", "0 -1 0"), "1.15 1 0", [0.05]),
        # Without a volume.
        (BOX, ball(0), "0 0 0", []),
        (BOX, box("0.2 0.2 1.9e-6"), "0 0 0", []),
        (BOX, box("0.2 0.2 2.1e-6"), "0 0 0", [0.1]),
        (BOX, shape("sdf"), "0 0 0", []),
    ],
)
def test_depth_of_primitives(first, second, xyz, expected):
    assert depths(apart(first, second, xyz)) == expected


def test_depth_of_rotated_box():
    # At 45 degrees the edge reaches 0.1 * sqrt(2) toward the other, 0.22 m away.
    scene = apart(BOX, BOX, "0.22 0 0", rpy=f"0 0 {math.pi / 4}")
    assert depths(scene) == [0.1 + 0.1 * math.sqrt(2) - 0.22]


def test_overlaps_are_sorted_by_depth():
    first = box("0.2 0.2 0.2") + box("0.2 0.2 0.2", "0 0 1")
    found = apart(first, ball(0.1, "0 0 0.17") + ball(0.1, "0 0 0.84"), "0 0 0").detect({})
    assert [each.depth for each in found] == [pytest.approx(0.04), pytest.approx(0.03)]
    assert {(each.first.link, each.second.link, each.has_mesh) for each in found} == {
        ("a", "c", False)
    }


def test_neighbors_are_ignored_and_siblings_are_not():
    a, b, c, d = (link(name, BOX, mass=None) for name in "abcd")
    assert depths(facts(a, b, spin("a", "b")).overlap_scene) == []
    # b is fixed to a, and d to c.
    arm = [a, b, joint("a", "b", kind="fixed"), link("c"), spin("a", "c")]
    assert depths(facts(*arm, d, joint("c", "d", kind="fixed")).overlap_scene) == []
    # At 0.1, half of a box, mj_geomDistance of MuJoCo 3.16 and 3.17 has the wrong sign.
    siblings = facts(link("a"), b, c, spin("a", "b", "0.11 0 0"), spin("a", "c"))
    assert depths(siblings.overlap_scene) == [0.09]


def test_invalid_masses_do_not_matter():
    heavy = [link("a", BOX, mass=-1, inertia="0 -1 0 0 0 0"), link("b"), link("c", BOX)]
    robot = facts(*heavy, spin("a", "b"), spin("b", "c", "0.15 0 0"))
    assert depths(robot.overlap_scene) == [0.05]


def mjcf(attributes="", contact="", joints='<joint name="j"/>'):
    return (
        f'<mujoco><worldbody><body name="a"><geom size="0.1"/><body name="b"><joint name="i"/>'
        '<inertial mass="1" pos="0 0 0" diaginertia="1 1 1"/><body name="c" pos="0.15 0 0">'
        f'{joints}<geom size="0.1" {attributes}/></body></body></body></worldbody>'
        f"{contact}</mujoco>"
    )


# The second body of two joints is a neighbor of the first one.
NEIGHBORS = (
    '<mujoco><worldbody><body name="a"><freejoint/><geom size="0.1"/><body name="b" pos="0.1 0 0">'
    '<joint name="i"/><joint name="j" axis="1 0 0"/><geom size="0.1"/></body></body>'
    "</worldbody></mujoco>"
)


@pytest.mark.parametrize(
    ("text", "count"),
    [
        (NEIGHBORS, 0),
        (mjcf(), 1),
        (mjcf('contype="0" conaffinity="0"'), 0),
        (mjcf('contype="2" conaffinity="2"'), 0),
        (mjcf('contype="2" conaffinity="1"'), 1),
        (mjcf('contype="1" conaffinity="2"'), 1),
        (mjcf('contype="0"'), 1),
        (mjcf(contact='<contact><exclude body1="a" body2="c"/></contact>'), 0),
        (mjcf(joints='<joint name="j"/><joint name="k" axis="1 0 0"/>'), 1),
    ],
)
def test_overlaps_match_contacts_of_mujoco(text, count):
    found = facts(text).overlap_scene.detect({})
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert len(found) == data.ncon == count
    assert [o.depth for o in found] == pytest.approx(-data.contact.dist, abs=1e-6)


@pytest.fixture
def cube(tmp_path):
    """Return a cube from 0 to 0.2 on each axis, whose center is not its origin."""
    trimesh.creation.box(bounds=[[0, 0, 0], [1, 1, 1]]).export(tmp_path / "cube.stl")
    return shape(f'mesh filename="{tmp_path}/cube.stl" scale="0.2 0.2 0.2"')


def test_mesh_is_placed_by_its_vertices_and_moves_with_its_body(cube):
    assert depths(apart(BOX, cube, "0.05 -0.1 -0.1")) == [0.05]
    assert depths(apart(BOX, cube, "0.11 -0.1 -0.1")) == []
    # A quarter turn about z: the mesh lies from -0.2 to 0 along x.
    turned = apart(BOX, cube, "0.28 -0.1 -0.1")
    assert depths(turned) == []
    (found,) = turned.detect({"c_joint": math.pi / 2})
    assert (found.depth, found.has_mesh) == (pytest.approx(0.02, abs=1e-5), True)


def test_flat_meshes_are_ignored(tmp_path):
    flat = trimesh.Trimesh([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)], [(0, 1, 2), (1, 3, 2)])
    flat.export(tmp_path / "flat.stl")
    assert depths(apart(BOX, shape(f'mesh filename="{tmp_path}/flat.stl"'), "0 0 0")) == []


def test_overlaps_depend_on_joint_positions():
    # An arm of 0.3 m: c starts beside a, and rotates into d.
    links = [link(name, BOX) for name in "acd"]
    joints = [spin("a", "b"), spin("b", "c", "0.3 0 0"), spin("a", "d", "0 0.35 0")]
    scene = facts(*links, link("b"), *joints).overlap_scene
    assert depths(scene) == []
    assert depths(scene, {"b_joint": math.pi / 2}) == [0.15]


def test_sweep_matches_detect():
    scene = apart(BOX, BOX, "0.22 0 0")
    angles = np.linspace(-3, 3, 7)
    swept = [[o.depth for o in found] for found in scene.sweep({"c_joint": angles}, len(angles))]
    assert swept == [depths(scene, {"c_joint": angle}) for angle in angles]
    assert [len(found) for found in swept] == [0, 1, 1, 0, 1, 1, 0]


def test_scene_without_shapes():
    assert facts(link("a")).overlap_scene.detect({}) == []
    assert list(facts("").overlap_scene.sweep({}, 3)) == [[], [], []]


@pytest.mark.parametrize(("limit", "count"), [(10, 3), (2, 2), (1, 1)])
def test_sweep_measures_the_closest_pairs(monkeypatch, limit, count):
    monkeypatch.setattr(overlap, "MAX_PAIRS", limit)
    balls = "".join(ball(0.1, f"0 0 {z}") for z in (0.15, 0, 0.1))
    found = depths(apart(ball(0.1), balls, "0 0 0"))
    assert found == [0.2, 0.1, 0.05][:count]


@pytest.mark.parametrize("count", [400, 401])
def test_scene_of_more_than_400_shapes_is_rejected(count):
    robot = facts(link("a", BOX * count))
    if count == 400:
        assert robot.overlap_scene.detect({}) == []
        return
    with pytest.raises(CannotCheckError, match="shapes: got 401; expected at most 400"):
        robot.overlap_scene.detect({})


def test_mesh_without_a_volume_is_not_checked(tmp_path):
    """1e-6 m: MuJoCo computes its hull, but rejects the mesh."""
    trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / "plate.stl")
    mesh = f'<mesh filename="{tmp_path}/plate.stl" scale="1e-5 1e-5 1e-5"/>'
    scene = apart(ball(0.1), f"<collision><geometry>{mesh}</geometry></collision>", "0 0 0")
    with pytest.raises(CannotCheckError, match="rejects a collision shape"):
        scene.detect({})


def test_bundled_quadruped_has_no_overlaps_when_it_stands(bundled):
    robot = bundled("quadruped.urdf")
    assert [o for o in robot.overlap_scene.detect(robot.default_pose) if o.depth > 0.001] == []
