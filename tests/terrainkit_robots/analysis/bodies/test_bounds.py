import numpy as np
import pytest
import trimesh

from terrainkit_robots.analysis.bodies.bounds import half_diagonal
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.mesh.mesh_cache import Meshes
from tests.small_robots import ball, box, facts, joint, link, shape

BALL = ball(0.1)
BAR = 'mesh filename="bar.stl"'
VISUAL_BAR = shape(BAR, "0 0 1", kind="visual")


class Counting(Meshes):
    """Mesh files that count how often vertices are requested."""

    requests = 0

    def vertices(self, mesh):
        self.requests += 1
        return super().vertices(mesh)


def arm(*shapes, place="0 0 0.5"):
    base = link("base", box("0.2 0.2 0.2"), mass=None)
    return base + link("tip", *shapes, mass=None) + joint("base", "tip", place)


@pytest.fixture
def robot(tmp_path):
    """Return a function that loads a base and a tip with shapes; a bar of 2 m is a file."""

    def make(*shapes, bar=True):
        (tmp_path / "arm.urdf").write_text(f'<robot name="r">{arm(*shapes)}</robot>')
        if bar:
            trimesh.creation.box((0.1, 0.1, 2.0)).export(tmp_path / "bar.stl")
        return Facts(load_robot(tmp_path / "arm.urdf"), Counting())

    return make


def always(_):
    return True


def half_shorter_than(length):
    return lambda box: half_diagonal(box) < length


def test_box_if_includes_joints_on_the_body(robot):
    found = robot(BALL)
    corners = found.body_bounds.box_if(found.bodies[0], always)
    assert corners == pytest.approx(np.array([[-0.1, -0.1, -0.1], [0.1, 0.1, 0.5]]))
    assert half_diagonal(corners) == pytest.approx(0.44**0.5 / 2)


def test_robot_size_is_the_diagonal_of_all_frames():
    assert facts(arm(place="0.3 -0.4 1.2")).body_bounds.robot_size == pytest.approx(1.3)


@pytest.mark.parametrize(
    ("length", "is_opened", "expected"),
    [
        pytest.param(0.1, False, None, id="not needed"),
        pytest.param(0.9, True, None, id="needed"),
        pytest.param(1.5, True, [[-0.1, -0.1, -0.1], [0.1, 0.1, 2.0]], id="longer than the bar"),
    ],
)
def test_box_if_opens_needed_meshes(robot, length, is_opened, expected):
    found = robot(BALL, VISUAL_BAR)
    corners = found.body_bounds.box_if(found.bodies[1], half_shorter_than(length))
    assert (corners is None) if expected is None else (corners == pytest.approx(np.array(expected)))
    assert (found.meshes.requests > 0) == is_opened


def test_box_if_pads_a_body_without_collisions_by_half_its_length(robot):
    # The tip is 0.5 m from the base: half the diagonal of +-0.25 m is 0.433 m.
    found = robot(VISUAL_BAR)
    for length, is_opened in ((0.43, False), (0.44, True)):
        found.body_bounds.box_if(found.bodies[1], half_shorter_than(length))
        assert (found.meshes.requests > 0) == is_opened


@pytest.mark.parametrize("shapes", [(), (shape(BAR),), (box("0.0049 0.001 0.001"),)])
def test_box_if_allows_three_robot_sizes_for_unreadable_shapes(robot, shapes):
    # The robot has a size of 0.5 m: half the diagonal of +-1.5 m is 2.6 m.
    found = robot(*shapes, bar=False)
    assert found.body_bounds.robot_size == pytest.approx(0.5)
    assert found.body_bounds.box_if(found.bodies[1], half_shorter_than(2.59)) is None
    assert found.body_bounds.box_if(found.bodies[1], half_shorter_than(2.61)) is not None


def test_box_if_of_a_readable_shape_is_not_padded(robot):
    found = robot(box("0.0051 0.001 0.001"))
    corners = found.body_bounds.box_if(found.bodies[1], always)
    assert corners[1] == pytest.approx([0.00255, 0.0005, 0.0005])


def test_shape_box_prefers_collision_shapes(robot):
    found = robot(BALL, VISUAL_BAR)
    corners = found.body_bounds.shape_box(found.bodies[1], always)
    assert corners == pytest.approx(np.array([[-0.1] * 3, [0.1] * 3]))
    assert found.meshes.requests == 0


def test_shape_box_opens_visual_mesh_only_if_needed(robot):
    found, lengths = robot(VISUAL_BAR), []
    assert found.body_bounds.shape_box(found.bodies[1], lengths.append) is None
    assert (lengths, found.meshes.requests) == ([pytest.approx(0.5)], 0)
    corners = found.body_bounds.shape_box(found.bodies[1], always)
    assert corners == pytest.approx(np.array([[-0.05, -0.05, 0], [0.05, 0.05, 2]]))
