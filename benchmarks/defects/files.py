"""Defects of mesh files."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from lxml import etree

from defects import solids
from defects.patient import NotHereError, Patient, Subjects, kind


@dataclass(frozen=True, kw_only=True)
class Mesh:
    """A mesh on a link."""

    link: str
    element: etree._Element
    triangles: np.ndarray

    def about(self) -> Subjects:
        """Return the names that a finding on it may have."""
        name = self.element.get("filename", "")
        return [self.link, name, Path(name.replace("\\", "/")).name, Path(name).stem]


def _made(shape: etree._Element) -> np.ndarray:
    if shape.tag == "box":
        half = np.array([float(word) for word in shape.get("size").split()]) / 2
        return solids.box(-half, half)
    if shape.tag == "sphere":
        return solids.sphere(8, 16) * float(shape.get("radius"))
    return solids.cylinder(float(shape.get("radius")), float(shape.get("length")))


def _mesh(robot: Patient, legs: bool = False) -> Mesh:
    """Choose a collision shape that is an STL; a primitive becomes one of the same form."""
    links = robot.leg_links() if legs else robot.links()
    link = robot.choose(e for e in links if e.find("collision/geometry") is not None)
    geometry = robot.choose(link.findall("collision/geometry"))
    shape = geometry[0]
    if shape.tag == "mesh":
        path = robot.folder / shape.get("filename")
        if path.suffix.lower() != ".stl":
            raise NotHereError
        triangles = solids.read_stl(path.read_bytes())
    else:
        triangles = _made(shape)
        geometry.remove(shape)
        shape = etree.SubElement(geometry, "mesh", filename=f"meshes/{robot.serial}.stl")
        robot.write(shape.get("filename"), solids.stl(triangles))
    return Mesh(link=link.get("name"), element=shape, triangles=triangles)


def _replaced(
    robot: Patient,
    content: Callable[[np.ndarray], bytes],
    suffix: str = ".stl",
) -> Subjects:
    """Give a mesh another content, in a file of its own."""
    mesh = _mesh(robot)
    mesh.element.set("filename", f"meshes/{robot.serial}_new{suffix}")
    robot.write(mesh.element.get("filename"), content(mesh.triangles))
    return mesh.about()


@kind("MSH001", "error", "a collision mesh that is not there")
def missing(robot: Patient) -> Subjects:
    mesh = _mesh(robot)
    mesh.element.set("filename", "meshes/lost.stl")
    return mesh.about()


@kind("MSH001", "warning", "a visual mesh that is not there")
def visual_missing(robot: Patient) -> Subjects:
    link = robot.choose(robot.links("visual/geometry"))
    geometry = link.find("visual/geometry")
    geometry.remove(geometry[0])
    etree.SubElement(geometry, "mesh", filename="meshes/lost.dae")
    return [link.get("name"), "lost.dae", "meshes/lost.dae", "lost"]


@kind("MSH002", "error", "an absolute path")
def absolute(robot: Patient) -> Subjects:
    mesh = _mesh(robot)
    prefix = robot.choose(["", "file://"])
    path = (robot.folder / mesh.element.get("filename")).resolve()
    mesh.element.set("filename", prefix + str(path))
    return mesh.about()


@kind("MSH002 MSH001", "error", "an absolute path of another machine")
def absolute_elsewhere(robot: Patient) -> Subjects:
    mesh = _mesh(robot)
    name = Path(mesh.element.get("filename")).name
    start = robot.choose(["/home/someone/catkin_ws/src/", "C:/Users/someone/", "file:///opt/"])
    mesh.element.set("filename", start + name)
    return mesh.about()


@kind("MSH003", "warning", "a package path")
def package(robot: Patient) -> Subjects:
    mesh = _mesh(robot)
    path = (robot.folder / mesh.element.get("filename")).resolve()
    top = next(p for p in path.parents if p.name == robot.healthy.label)
    mesh.element.set("filename", f"package://{top.name}/{path.relative_to(top)}")
    return mesh.about()


@kind("MSH003 MSH001", "warning", "a package that is not there, though the file is")
def lost_package(robot: Patient) -> Subjects:
    mesh = _mesh(robot)
    name = Path(mesh.element.get("filename")).name
    mesh.element.set("filename", f"package://lost_description/meshes/{name}")
    return mesh.about()


@kind("MSH001", "error", "a package that is not there, nor is the file")
def lost_package_and_file(robot: Patient) -> Subjects:
    mesh = _mesh(robot)
    mesh.element.set("filename", "package://lost_description/meshes/lost.stl")
    return mesh.about()


@kind("MSH004", "error", "a path in other letters")
def other_case(robot: Patient) -> Subjects:
    mesh = _mesh(robot)
    path = Path(mesh.element.get("filename"))
    mesh.element.set("filename", str(path.with_name(path.name.swapcase())))
    return mesh.about()


@kind("MSH004", "error", "a path with backslashes")
def backslashes(robot: Patient) -> Subjects:
    mesh = _mesh(robot)
    mesh.element.set("filename", mesh.element.get("filename").replace("/", "\\"))
    return mesh.about()


@kind("MSH005", "error", "a collision mesh in Collada")
def collada(robot: Patient) -> Subjects:
    return _replaced(robot, solids.collada, ".dae")


@kind("MSH005", "error", "a collision mesh in PLY")
def ply(robot: Patient) -> Subjects:
    return _replaced(robot, solids.ply, ".ply")


@kind("MSH006", "error", "an STL that was cut off")
def cut_off(robot: Patient) -> Subjects:
    return _replaced(robot, lambda t: solids.stl(t)[: -robot.rng.randrange(1, 60)])


@kind("MSH006", "error", "an STL that claims four billion faces")
def too_many_claimed(robot: Patient) -> Subjects:
    return _replaced(robot, lambda t: (d := solids.stl(t))[:80] + b"\xff\xff\xff\xff" + d[84:])


@kind("MSH006", "error", "a web page in the place of an STL")
def web_page(robot: Patient) -> Subjects:
    return _replaced(robot, lambda _: b"<!DOCTYPE html><html><body>404</body></html>" * 20)


@kind("MSH006 MSH010", "error", "an empty file")
def zero_bytes(robot: Patient) -> Subjects:
    return _replaced(robot, lambda _: b"")


@kind("MSH007", "error", "an STL in text")
def ascii_stl(robot: Patient) -> Subjects:
    return _replaced(robot, solids.ascii_stl)


def _sphere(robot: Patient, rings: int, sectors: int) -> Subjects:
    def content(triangles: np.ndarray) -> bytes:
        lower, upper = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
        ball = solids.sphere(rings, sectors)
        return solids.stl((lower + upper) / 2 + ball * (upper - lower) / 2)

    return _replaced(robot, content)


@kind("MSH008", "error", "a mesh of over 200,000 faces")
def huge(robot: Patient) -> Subjects:
    return _sphere(robot, 320, 320)


@kind("MSH009", "warning", "a collision mesh of over 20,000 faces")
def large(robot: Patient) -> Subjects:
    return _sphere(robot, 110, 110)


@kind("MSH010", "error", "a flat collision mesh")
def flat(robot: Patient) -> Subjects:
    axis = robot.rng.randrange(3)
    return _replaced(robot, lambda t: solids.stl(t * (np.arange(3) != axis)))


@kind("MSH010 MSH006", "error", "an STL without faces")
def faceless(robot: Patient) -> Subjects:
    return _replaced(robot, lambda t: solids.stl(t[:0]))


@kind("MSH011", "error", "a mesh in millimetres")
def millimetres(robot: Patient) -> Subjects:
    mesh = _mesh(robot, legs=True)
    mesh.element.set("scale", "1000 1000 1000")
    return mesh.about()


@kind("MSH011", "error", "a mesh a thousand times too small")
def kilometres(robot: Patient) -> Subjects:
    mesh = _mesh(robot, legs=True)
    mesh.element.set("scale", "0.001 0.001 0.001")
    return mesh.about()


@kind("MSH011", "warning", "a mesh in inches")
def inches(robot: Patient) -> Subjects:
    mesh = _mesh(robot, legs=True)
    mesh.element.set("scale", "39.37 39.37 39.37")
    return mesh.about()


@kind("MSH012", "warning", "a scale that mirrors")
def mirrored(robot: Patient) -> Subjects:
    mesh = _mesh(robot)
    mesh.element.set("scale", robot.choose(["1 -1 1", "-1 1 1", "-1 -1 -1"]))
    return mesh.about()


@kind("MSH013", "error", "a Git LFS pointer")
def pointer(robot: Patient) -> Subjects:
    text = (
        b"version https://git-lfs.github.com/spec/v1\noid sha256:" + b"0a" * 32 + b"\nsize 98284\n"
    )
    return _replaced(robot, lambda _: text)


@kind("MSH014", "info", "a collision mesh far from convex")
def hollow(robot: Patient) -> Subjects:
    return _replaced(
        robot, lambda t: solids.stl(solids.channel(t.min(axis=(0, 1)), t.max(axis=(0, 1))))
    )
