"""Check whether MuJoCo loads a file unchanged.

It opens all referenced files, without limits on time and memory. Therefore the cost is estimated
first, and a file that could take more than seconds is not passed to it.
"""

import copy
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from terrainkit.settings.text import truncate
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.description.mjcf.tree import MAX_ELEMENTS, is_allowed
from terrainkit_robots.description.model import RobotModel
from terrainkit_robots.description.xml.document import RobotFileError, parse_xml, read_bytes
from terrainkit_robots.files import is_utf8, open_regular
from terrainkit_robots.quiet_mujoco import quiet_mujoco

if TYPE_CHECKING:
    from lxml import etree

MAX_BODIES = 600
"""The time of MuJoCo's compiler grows with the third power of a chain: half a second for these."""

_MAX_BYTES = 32 * 2**20
"""Size of all referenced files: about two seconds for their convex hulls."""

_MAX_PIXELS = 4096 * 4096
"""Size of a texture, whether it is read or generated, and of a heightfield."""

_GRIDS = {"texture": ("width", "height"), "hfield": ("nrow", "ncol")}
"""Elements that MuJoCo allocates a grid for, and the attributes with its size."""

_MAX_ALLOCATION = 1_000
"""Largest number in <size>, which allocates user data of every element, and keyframes."""

MAX_PATHS = 20_000
"""Number of paths at which files are searched."""

_UNSAFE_TAGS = frozenset(
    {"replicate", "composite", "flexcomp", "plugin", "extension", "skin", "flex"}
)
"""Elements that generate other elements, or run external code."""

_URDF_TAGS = frozenset({"link", "joint", "material"})
"""Elements of a URDF that MuJoCo reads besides <mujoco>; it ignores all others."""

_TETRAHEDRON = b"""v 0 0 0
v 1 0 0
v 0 1 0
v 0 0 1
f 1 3 2
f 1 2 4
f 1 4 3
f 2 3 4
"""
"""OBJ file that replaces each mesh file."""

_FOLDER_ATTRIBUTES = frozenset({"meshdir", "texturedir", "assetdir"})

_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"


@dataclass(frozen=True, kw_only=True)
class LoadError:
    """Why MuJoCo does not load a file."""

    message: str
    """The message of MuJoCo, on one line."""

    element: str = ""
    """Name of the element that it refers to. Empty without one."""

    line: int = 0
    """Line of the element, or 0 if it is not known."""


def mujoco_load_error(model: RobotModel, *, with_meshes: bool = True) -> LoadError | None:
    """Return why MuJoCo does not compile the file; None if it does.

    Args:
        model: The robot.
        with_meshes: Whether MuJoCo opens the mesh files. If not, a tetrahedron replaces each mesh,
            so that an error in a mesh file does not hide the others; URDF only.

    Raises:
        CannotCheckError: if the file is not passed to MuJoCo.
    """
    if not with_meshes and model.kind != "urdf":
        raise CannotCheckError("only URDF is compiled without its mesh files")
    check_mujoco_cost(model, with_files=with_meshes)
    import mujoco

    replaced = _without_repeated_names(model) if with_meshes else {}
    try:
        with quiet_mujoco():
            if with_meshes:
                mujoco.MjModel.from_xml_path(str(model.file), replaced)
            else:
                mujoco.MjModel.from_xml_string(*_without_meshes(model))
    except (ValueError, RuntimeError, mujoco.FatalError, mujoco.UnexpectedError) as error:
        text = str(error)
        lines = [re.sub(r"^(XML )?Error:\s*", "", line.strip()) for line in text.splitlines()]
        informative = (line for line in lines if line and not line.startswith("Element "))
        message = " ".join(next(informative, "no reason").split())
        element = re.search(r"Element name '([^']*)'", text)
        line = re.search(r"^Element .*\bline (\d+)$", text, re.MULTILINE)
        is_unchanged = with_meshes and not replaced and len(model.sources) == 1
        return LoadError(
            message=truncate(message, 200),
            element=element[1] if element else "",
            line=int(line[1]) if line and is_unchanged else 0,
        )
    return None


def check_mujoco_cost(model: RobotModel, *, with_files: bool = True) -> None:
    """Raise an error if MuJoCo must not read the file, or would take too long.

    Args:
        model: The robot.
        with_files: Whether MuJoCo opens the files that it refers to.

    Raises:
        CannotCheckError: if the file is not passed to MuJoCo.
    """
    if model.kind == "xacro":
        raise CannotCheckError("MuJoCo does not read xacro, and the expanded text has no file")
    if len(model.links) > MAX_BODIES:
        raise CannotCheckError(
            f"number of bodies: got {len(model.links)}; expected at most {MAX_BODIES} for MuJoCo"
        )
    if not is_utf8(model.file):
        raise CannotCheckError("MuJoCo opens only paths that are UTF-8")
    _check_cost(model.sources, with_files=with_files)


def _without_repeated_names(model: RobotModel) -> dict[str, bytes]:
    """Return a URDF in which names of shapes repeat without these names, by its file name.

    MuJoCo ignores a repeated name, but prints a warning.
    """
    from lxml import etree

    shapes = [shape for link in model.links for shape in (*link.collisions, *link.visuals)]
    names = [shape.name for shape in shapes if shape.name]
    if model.kind != "urdf" or len(set(names)) == len(names):
        return {}
    return {model.file.name: etree.tostring(_without_names(model))}


def _without_names(model: RobotModel) -> "etree._Element":
    """Return the root of a URDF whose collisions and visuals have no names."""
    root = parse_xml(model.file, _read(model.file)).root
    if root is None:
        raise CannotCheckError("a file without elements is not passed to MuJoCo")
    root = copy.deepcopy(root)
    for shape in root.iter("collision", "visual"):
        shape.attrib.pop("name", None)
    return root


def _without_meshes(model: RobotModel) -> tuple[str, Mapping[str, bytes]]:
    """Return the text of a URDF in which a tetrahedron replaces each mesh, and its assets."""
    from lxml import etree

    root = _without_names(model)
    files: dict[str, str] = {}
    for mesh in root.iter("mesh"):
        if "filename" in mesh.attrib:
            mesh.attrib.pop("scale", "")  # which may be too small for MuJoCo
            name = files.setdefault(mesh.get("filename", ""), f"{len(files)}.obj")
            mesh.set("filename", name)
    for compiler in root.iter("compiler"):
        for name in _FOLDER_ATTRIBUTES & set(map(str, compiler.keys())):
            del compiler.attrib[name]
    return etree.tostring(root, encoding="unicode"), dict.fromkeys(files.values(), _TETRAHEDRON)


def _read(path: Path) -> bytes:
    try:
        return read_bytes(path)
    except RobotFileError as error:
        raise CannotCheckError(str(error)) from None


def _check_cost(files: tuple[Path, ...], *, with_files: bool) -> None:
    """Check all files that MuJoCo would open and all objects that it would generate.

    Raises:
        CannotCheckError: if they could be too large.
    """
    elements = 0
    directories = {Path()}
    names = set[str]()
    for source in files:
        for element in _relevant_elements(parse_xml(source, _read(source)).root):
            elements += 1
            if elements > MAX_ELEMENTS:
                raise CannotCheckError(
                    f"number of elements: expected at most {MAX_ELEMENTS} for MuJoCo"
                )
            _check_element(element)
            directories |= {Path(v) for k, v in element.attrib.items() if k in _FOLDER_ATTRIBUTES}
            names |= {v for k, v in element.attrib.items() if k.startswith("file") and v}
    if not with_files:
        return
    parents = {source.parent for source in files}
    paths = len(names) * len(parents) * len(directories)
    if paths > MAX_PATHS:
        raise CannotCheckError(
            f"number of files and folders: got {paths} paths; expected at most {MAX_PATHS}"
        )
    _check_files({path for name in names for path in _candidates(name, parents, directories)})


def _relevant_elements(root: "etree._Element | None") -> Iterator["etree._Element"]:
    """Yield the elements that MuJoCo reads."""
    if root is None:
        return
    is_urdf = root.tag == "robot"
    yield root
    for child in root:
        if not is_urdf or child.tag in _URDF_TAGS or child.tag == "mujoco":
            yield from (element for element in child.iter() if isinstance(element.tag, str))


def _check_element(element: "etree._Element") -> None:
    tag = str(element.tag)
    if tag in ("include", "model"):
        return  # the file that it refers to is one of the sources
    if tag in _UNSAFE_TAGS or not is_allowed(tag):
        raise CannotCheckError(f"a file with <{tag}> is not passed to MuJoCo")
    attributes = {str(name): str(value) for name, value in element.attrib.items()}
    side = max((_size(attributes.pop(name, "1")) for name in _GRIDS.get(tag, ())), default=1)
    if side * side > _MAX_PIXELS:
        raise CannotCheckError(
            f"{tag}: got {side:g} pixels per side; expected at most {_MAX_PIXELS**0.5:g}"
        )
    for name, text in attributes.items():
        if (not is_allowed(tag, name) and name != "user") or "octree" in name:
            raise CannotCheckError(f"<{tag} {name}=...> is not passed to MuJoCo")
        is_allocation = tag == "size" and (name.startswith("nuser") or name == "nkey")
        if is_allocation and _size(text) > _MAX_ALLOCATION:
            raise CannotCheckError(f"<size {name}={truncate(text, 20)!r}> is not passed to MuJoCo")


def _size(text: str) -> float:
    """Return the absolute value of a number, or infinity if the text is not a number."""
    try:
        return abs(float(text))
    except ValueError:
        return float("inf")


def _candidates(name: str, parents: set[Path], directories: set[Path]) -> Iterator[Path]:
    """Yield the paths at which MuJoCo may look for a file, with and without its own directories."""
    base_name = re.split(r"[/\\]", name)[-1]
    for written in {name, base_name, re.sub(r"^\w+:/+", "", name)}:
        for folder in directories:
            yield from (source / folder / written for source in parents)


def _check_files(paths: set[Path]) -> None:
    seen, size = set(), 0
    for path in paths:
        try:
            if not path.exists():
                continue
            with open_regular(path) as stream:
                head = stream.read(24)
                size += stream.seek(0, 2) if (real := path.resolve()) not in seen else 0
            seen.add(real)
        except (OSError, ValueError, RuntimeError) as error:
            raise CannotCheckError(f"{path.name} is not passed to MuJoCo: {error}") from None
        if head.startswith(_PNG_SIGNATURE):
            width, height = (int.from_bytes(head[k : k + 4], "big") for k in (16, 20))
            if width * height > _MAX_PIXELS:
                raise CannotCheckError(
                    f"{path.name}: got {width} x {height} pixels; expected at most {_MAX_PIXELS:,}"
                )
        if size > _MAX_BYTES:
            raise CannotCheckError(f"size of its meshes: expected at most {_MAX_BYTES:,} bytes")
