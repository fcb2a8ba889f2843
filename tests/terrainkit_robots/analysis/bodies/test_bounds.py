from pathlib import Path

import numpy as np
import pytest
import trimesh

from terrainkit_robots.analysis.bodies.bounds import half_diagonal
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.mesh.mesh_cache import Meshes

ARM = """<robot name="arm">
  <link name="base"><collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>
  <joint name="turn" type="continuous">
    <parent link="base"/><child link="tip"/><origin xyz="0 0 0.5"/>
  </joint>
  <link name="tip">{shapes}</link>
</robot>"""
BALL = "<{0}><geometry><sphere radius='0.1'/></geometry></{0}>"
BAR = (
    "<{0}><origin xyz='0 0 1'/><geometry><mesh filename='bar.stl' scale='1 1 1'/></geometry></{0}>"
)


class Counting(Meshes):
    """Mesh files that count how often vertices are requested."""

    requests = 0

    def vertices(self, mesh):
        self.requests += 1
        return super().vertices(mesh)


@pytest.fixture
def robot(tmp_path):
    def make(*shapes, bar=True):
        (tmp_path / "arm.urdf").write_text(ARM.format(shapes="".join(shapes)))
        if bar:
            trimesh.creation.box((0.1, 0.1, 2.0)).export(tmp_path / "bar.stl")
        return Facts(load_robot(tmp_path / "arm.urdf"), Counting())

    return make


def always(_):
    return True


def longer_than(length):
    return lambda box: half_diagonal(box) < length


def test_box_if_includes_joints_on_the_body(robot):
    facts = robot(BALL.format("collision"))
    box = facts.body_bounds.box_if(facts.bodies[0], always)
    assert box == pytest.approx(np.array([[-0.1, -0.1, -0.1], [0.1, 0.1, 0.5]]))


def test_robot_size_is_the_diagonal_of_all_frames():
    file = Path("robot.urdf")
    text = ARM.format(shapes="").replace("0 0 0.5", "0.3 -0.4 1.2")
    facts = Facts(load_robot(file, contents={file: text.encode()}))
    assert facts.body_bounds.robot_size == pytest.approx(1.3)


def test_box_if_skips_unneeded_meshes(robot):
    facts = robot(BALL.format("collision"), BAR.format("visual"))
    assert facts.body_bounds.box_if(facts.bodies[1], longer_than(0.1)) is None
    assert facts.meshes.requests == 0


def test_box_if_opens_needed_meshes(robot):
    facts = robot(BALL.format("collision"), BAR.format("visual"))
    assert facts.body_bounds.box_if(facts.bodies[1], longer_than(0.9)) is None
    assert facts.meshes.requests > 0


def test_box_if_returns_box_when_condition_holds(robot):
    facts = robot(BALL.format("collision"), BAR.format("visual"))
    box = facts.body_bounds.box_if(facts.bodies[1], longer_than(1.5))
    assert box == pytest.approx(np.array([[-0.1, -0.1, -0.1], [0.1, 0.1, 2.0]]))


@pytest.mark.parametrize("shapes", [(), (BAR.format("collision"),)])
def test_box_if_allows_for_unreadable_shapes(robot, shapes):
    facts = robot(*shapes, bar=False)
    assert facts.body_bounds.robot_size == pytest.approx(0.5)
    assert facts.body_bounds.box_if(facts.bodies[1], longer_than(1.2)) is None
    assert facts.body_bounds.box_if(facts.bodies[1], longer_than(5.0)) is not None


@pytest.mark.parametrize(("size", "is_marker"), [(0.0049, True), (0.0051, False)])
def test_box_if_ignores_marker_shapes(robot, size, is_marker):
    box = f"<box size='{size} 0.001 0.001'/>"
    facts = robot(f"<collision><geometry>{box}</geometry></collision>")
    found = facts.body_bounds.box_if(facts.bodies[1], longer_than(1.2))
    assert (found is None) == is_marker


def test_shape_box_prefers_collision_shapes(robot):
    facts = robot(BALL.format("collision"), BAR.format("visual"))
    box = facts.body_bounds.shape_box(facts.bodies[1], always)
    assert box == pytest.approx(np.array([[-0.1] * 3, [0.1] * 3]))
    assert facts.meshes.requests == 0


def test_shape_box_opens_visual_mesh_only_if_needed(robot):
    facts = robot(BAR.format("visual"))
    requests = []
    assert (
        facts.body_bounds.shape_box(facts.bodies[1], lambda length: bool(requests.append(length)))
        is None
    )
    assert requests == [pytest.approx(0.5)]
    assert facts.meshes.requests == 0
    assert facts.body_bounds.shape_box(facts.bodies[1], always)[1, 2] == pytest.approx(2.0)


def test_body_bounds_are_cached(robot):
    facts = robot(BALL.format("collision"))
    assert facts.body_bounds is facts.body_bounds
