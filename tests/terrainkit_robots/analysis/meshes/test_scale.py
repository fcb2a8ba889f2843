from itertools import pairwise

import numpy as np
import pytest
import trimesh

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.meshes.scale import MeshScales
from terrainkit_robots.analysis.meshes.uses import mesh_uses
from terrainkit_robots.description.model import (
    Geometry,
    Inertial,
    Joint,
    Link,
    MeshFile,
    RobotModel,
    Source,
)
from terrainkit_robots.mesh.surface import Surface, binary_stl


class Builder:
    """Builds chains of links at distance `reach`, with boxes as meshes."""

    def __init__(self, folder):
        self.folder = folder
        self.at = Source(file=folder / "robot.urdf", line=1)

    def mesh(self, size, scale=1.0):
        path = self.folder / f"{size}.stl"
        box = trimesh.creation.box([size, size / 2, size / 2])
        path.write_bytes(binary_stl(Surface(points=box.vertices, faces=box.faces)))
        file = MeshFile(source=self.at, filename=path.name, path=path, scale=(scale,) * 3)
        return Geometry(source=self.at, shape="mesh", mesh=file)

    def link(self, name, *visuals, collisions=(), mass=1.0):
        inertial = None if mass is None else Inertial(source=self.at, mass=mass)
        return Link(
            name=name, source=self.at, visuals=visuals, collisions=collisions, inertial=inertial
        )

    def mismatches(self, *links, reach=0.3):
        offset = np.eye(4)
        offset[2, 3] = -reach
        joints = [
            Joint(
                name=f"{above.name}_{below.name}",
                source=self.at,
                kind="revolute",
                parent=above.name,
                child=below.name,
                origin=offset,
            )
            for above, below in pairwise(links)
        ]
        facts = Facts(
            RobotModel(
                name="r",
                kind="urdf",
                file=self.at.file,
                source=self.at,
                links=links,
                joints=tuple(joints),
            )
        )
        scales = MeshScales(facts.tree, facts.bodies, facts.meshes)
        found = [scales.mismatch(use) for use in mesh_uses(facts.model)]
        return [mismatch.ratio for mismatch in found if mismatch is not None]


@pytest.fixture
def robot(tmp_path):
    return Builder(tmp_path)


@pytest.mark.parametrize("size", [0.01, 0.05, 0.3, 1.0, 2.5])
def test_mismatch_accepts_common_sizes(robot, size):
    part = robot.mesh(size)
    links = [robot.link(name, part, collisions=(part,)) for name in "abc"]
    assert not robot.mismatches(*links)


@pytest.mark.parametrize("size", [0.02, 0.05, 0.3])
def test_mismatch_of_millimeters_as_meters(robot, size):
    part = robot.mesh(size * 1000)
    ratios = robot.mismatches(*(robot.link(name, part) for name in "abc"))
    assert len(ratios) == 3
    assert min(ratios) > 15
    assert not robot.mismatches(
        *(robot.link(name, robot.mesh(1000 * size, 0.001)) for name in "abc")
    )


@pytest.mark.parametrize("size", [0.01, 0.05, 0.3])
def test_mismatch_of_meters_as_millimeters(robot, size):
    part = robot.mesh(size, 0.001)
    box = Geometry(source=robot.at, shape="box", size=(size / 2,) * 3)
    ratios = robot.mismatches(*(robot.link(name, part, collisions=(box,)) for name in "abc"))
    assert len(ratios) == 3
    assert max(ratios) < 0.02


def test_mismatch_of_one_mesh(robot):
    right, wrong = robot.mesh(0.3), robot.mesh(0.31, 1000.0)
    links = [robot.link(name, right) for name in "abcd"]
    assert robot.mismatches(*links[:2], robot.link("x", wrong), *links[2:]) == pytest.approx(
        [380 / 0.3], rel=0.01
    )


def test_mismatch_accepts_small_details(robot):
    screw, shell = robot.mesh(0.002), robot.mesh(0.3)
    assert not robot.mismatches(*(robot.link(name, shell, screw) for name in "abc"))


def test_mismatch_accepts_intersecting_axes(robot):
    part = robot.mesh(0.2)
    wrist = [robot.link(name, part) for name in "abc"]
    assert not robot.mismatches(*wrist, reach=0.0)
    assert not robot.mismatches(*wrist, reach=0.004)


def test_mismatch_accepts_camera_on_vehicle(robot):
    assert not robot.mismatches(
        robot.link("car", robot.mesh(2.0)), robot.link("camera"), reach=0.05
    )


def test_mismatch_accepts_massless_environment(robot):
    room = robot.mesh(50.0)
    part = robot.mesh(0.3)
    links = [robot.link("a", part), robot.link("b", part)]
    assert not robot.mismatches(robot.link("room", room, mass=None), *links)
    assert robot.mismatches(robot.link("room", room, mass=3.0), *links) == pytest.approx(
        [61.2 / 0.6], rel=0.01
    )


def test_mismatch_accepts_crane(robot):
    links = [robot.link(name, robot.mesh(size)) for name, size in (("a", 8.0), ("b", 25.0))]
    assert not robot.mismatches(*links, reach=8.0)


def test_mismatch_ignores_unreadable_mesh(robot):
    lost = Geometry(
        source=robot.at,
        shape="mesh",
        mesh=MeshFile(source=robot.at, filename="x", path=robot.folder / "x.stl"),
    )
    assert not robot.mismatches(robot.link("a", lost), robot.link("b", lost))


def test_mismatch_ignores_invalid_offsets(robot):
    part = robot.mesh(0.3)
    assert not robot.mismatches(robot.link("a", part), robot.link("b", part), reach=1e9)
