"""Defects of mesh files (MSH)."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from lxml import etree

from defects import solids
from defects.mutant import Mutant, NotApplicableError, Subjects, mutation


@dataclass(frozen=True, kw_only=True)
class Mesh:
    """A mesh of a link."""

    link: str
    element: etree._Element
    triangles: np.ndarray

    def subjects(self) -> Subjects:
        """Return the subjects of findings on the mesh."""
        name = self.element.get("filename", "")
        return [self.link, name, Path(name.replace("\\", "/")).name, Path(name).stem]


def _triangulate(shape: etree._Element) -> np.ndarray:
    if shape.tag == "box":
        half = np.array([float(word) for word in shape.get("size").split()]) / 2
        return solids.box(-half, half)
    if shape.tag == "sphere":
        return solids.sphere(8, 16) * float(shape.get("radius"))
    return solids.cylinder(float(shape.get("radius")), float(shape.get("length")))


def _pick_mesh(robot: Mutant, legs: bool = False) -> Mesh:
    """Return a random collision shape as an STL; convert a primitive to a mesh."""
    links = robot.leg_links() if legs else robot.links()
    link = robot.pick(e for e in links if e.find("collision/geometry") is not None)
    geometry = robot.pick(link.findall("collision/geometry"))
    shape = geometry[0]
    if shape.tag == "mesh":
        path = robot.folder / shape.get("filename")
        if path.suffix.lower() != ".stl":
            raise NotApplicableError
        triangles = solids.read_stl(path.read_bytes())
    else:
        triangles = _triangulate(shape)
        geometry.remove(shape)
        shape = etree.SubElement(geometry, "mesh", filename=f"meshes/{robot.prefix}.stl")
        robot.write(shape.get("filename"), solids.stl(triangles))
    return Mesh(link=link.get("name"), element=shape, triangles=triangles)


def _replace_mesh(
    robot: Mutant,
    content: Callable[[np.ndarray], bytes],
    suffix: str = ".stl",
) -> Subjects:
    """Replace a random mesh by a new file."""
    mesh = _pick_mesh(robot)
    mesh.element.set("filename", f"meshes/{robot.prefix}_new{suffix}")
    robot.write(mesh.element.get("filename"), content(mesh.triangles))
    return mesh.subjects()


@mutation("MSH001", "error", "missing collision mesh")
def missing_collision(robot: Mutant) -> Subjects:
    mesh = _pick_mesh(robot)
    mesh.element.set("filename", "meshes/lost.stl")
    return mesh.subjects()


@mutation("MSH001", "warning", "missing visual mesh")
def missing_visual(robot: Mutant) -> Subjects:
    link = robot.pick(robot.links("visual/geometry"))
    geometry = link.find("visual/geometry")
    geometry.remove(geometry[0])
    etree.SubElement(geometry, "mesh", filename="meshes/lost.dae")
    return [link.get("name"), "lost.dae", "meshes/lost.dae", "lost"]


@mutation("MSH002", "error", "absolute path")
def absolute_path(robot: Mutant) -> Subjects:
    mesh = _pick_mesh(robot)
    prefix = robot.pick(["", "file://"])
    path = (robot.folder / mesh.element.get("filename")).resolve()
    mesh.element.set("filename", prefix + str(path))
    return mesh.subjects()


@mutation("MSH002 MSH001", "error", "absolute path of another computer")
def foreign_path(robot: Mutant) -> Subjects:
    mesh = _pick_mesh(robot)
    name = Path(mesh.element.get("filename")).name
    start = robot.pick(["/home/someone/catkin_ws/src/", "C:/Users/someone/", "file:///opt/"])
    mesh.element.set("filename", start + name)
    return mesh.subjects()


@mutation("MSH003", "info", "package path")
def package_path(robot: Mutant) -> Subjects:
    mesh = _pick_mesh(robot)
    path = (robot.folder / mesh.element.get("filename")).resolve()
    top = next(p for p in path.parents if p.name == robot.source.label)
    mesh.element.set("filename", f"package://{top.name}/{path.relative_to(top)}")
    return mesh.subjects()


@mutation("MSH003 MSH001", "info", "missing package with an existing file")
def missing_package(robot: Mutant) -> Subjects:
    mesh = _pick_mesh(robot)
    name = Path(mesh.element.get("filename")).name
    mesh.element.set("filename", f"package://lost_description/meshes/{name}")
    return mesh.subjects()


@mutation("MSH001", "error", "missing package and file")
def missing_package_file(robot: Mutant) -> Subjects:
    mesh = _pick_mesh(robot)
    mesh.element.set("filename", "package://lost_description/meshes/lost.stl")
    return mesh.subjects()


@mutation("MSH004", "error", "path in the wrong case")
def path_case(robot: Mutant) -> Subjects:
    mesh = _pick_mesh(robot)
    path = Path(mesh.element.get("filename"))
    mesh.element.set("filename", str(path.with_name(path.name.swapcase())))
    return mesh.subjects()


@mutation("MSH004", "error", "path with backslashes")
def windows_path(robot: Mutant) -> Subjects:
    mesh = _pick_mesh(robot)
    mesh.element.set("filename", mesh.element.get("filename").replace("/", "\\"))
    return mesh.subjects()


@mutation("MSH005", "error", "collision mesh in COLLADA format")
def collada(robot: Mutant) -> Subjects:
    return _replace_mesh(robot, solids.collada, ".dae")


@mutation("MSH005", "error", "collision mesh in PLY format")
def ply(robot: Mutant) -> Subjects:
    return _replace_mesh(robot, solids.ply, ".ply")


@mutation("MSH006", "error", "truncated STL")
def truncated(robot: Mutant) -> Subjects:
    return _replace_mesh(robot, lambda t: solids.stl(t)[: -robot.rng.randrange(1, 60)])


@mutation("MSH006", "error", "STL whose header has 4 billion faces")
def wrong_face_count(robot: Mutant) -> Subjects:
    return _replace_mesh(robot, lambda t: (d := solids.stl(t))[:80] + b"\xff\xff\xff\xff" + d[84:])


@mutation("MSH006", "error", "web page instead of an STL")
def web_page(robot: Mutant) -> Subjects:
    return _replace_mesh(robot, lambda _: b"<!DOCTYPE html><html><body>404</body></html>" * 20)


@mutation("MSH006 MSH010", "error", "empty file")
def zero_bytes(robot: Mutant) -> Subjects:
    return _replace_mesh(robot, lambda _: b"")


@mutation("MSH007", "error", "ASCII STL")
def ascii_stl(robot: Mutant) -> Subjects:
    return _replace_mesh(robot, solids.ascii_stl)


def _sphere(robot: Mutant, rings: int, sectors: int) -> Subjects:
    def content(triangles: np.ndarray) -> bytes:
        lower, upper = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
        ball = solids.sphere(rings, sectors)
        return solids.stl((lower + upper) / 2 + ball * (upper - lower) / 2)

    return _replace_mesh(robot, content)


@mutation("MSH008", "error", "mesh with more than 200,000 faces")
def max_faces(robot: Mutant) -> Subjects:
    return _sphere(robot, 320, 320)


@mutation("MSH009", "warning", "collision mesh with more than 20,000 faces")
def dense_mesh(robot: Mutant) -> Subjects:
    return _sphere(robot, 110, 110)


@mutation("MSH010", "error", "flat collision mesh")
def flat(robot: Mutant) -> Subjects:
    axis = robot.rng.randrange(3)
    return _replace_mesh(robot, lambda t: solids.stl(t * (np.arange(3) != axis)))


@mutation("MSH010 MSH006", "error", "STL without faces")
def no_faces(robot: Mutant) -> Subjects:
    return _replace_mesh(robot, lambda t: solids.stl(t[:0]))


@mutation("MSH011", "error", "mesh in millimeters")
def large_scale(robot: Mutant) -> Subjects:
    mesh = _pick_mesh(robot, legs=True)
    mesh.element.set("scale", "1000 1000 1000")
    return mesh.subjects()


@mutation("MSH011", "error", "mesh that is 1000 times too small")
def low_scale(robot: Mutant) -> Subjects:
    mesh = _pick_mesh(robot, legs=True)
    mesh.element.set("scale", "0.001 0.001 0.001")
    return mesh.subjects()


@mutation("MSH011", "warning", "mesh in inches")
def inch_scale(robot: Mutant) -> Subjects:
    mesh = _pick_mesh(robot, legs=True)
    mesh.element.set("scale", "39.37 39.37 39.37")
    return mesh.subjects()


@mutation("MSH012", "warning", "negative scale")
def negative_scale(robot: Mutant) -> Subjects:
    mesh = _pick_mesh(robot)
    mesh.element.set("scale", robot.pick(["1 -1 1", "-1 1 1", "-1 -1 -1"]))
    return mesh.subjects()


@mutation("MSH013", "error", "Git LFS pointer")
def pointer(robot: Mutant) -> Subjects:
    text = (
        b"version https://git-lfs.github.com/spec/v1\noid sha256:" + b"0a" * 32 + b"\nsize 98284\n"
    )
    return _replace_mesh(robot, lambda _: text)


@mutation("MSH014", "info", "collision mesh that is far from convex")
def nonconvex(robot: Mutant) -> Subjects:
    return _replace_mesh(
        robot, lambda t: solids.stl(solids.channel(t.min(axis=(0, 1)), t.max(axis=(0, 1))))
    )
