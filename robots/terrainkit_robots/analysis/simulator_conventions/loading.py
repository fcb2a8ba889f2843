"""Loading: whether MuJoCo and yourdfpy read the very file, as it stands.

Both open what a file tells them to, and take what time it takes. So it is looked at before what
they would open and make, and a file that could cost more than seconds is not given to them.
"""

import io
import logging
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from terrainkit_robots.description.mjcf.document import MAX_ELEMENTS, harmless
from terrainkit_robots.description.xml.document import RobotFileError, parse_xml, read_bytes
from terrainkit_robots.mesh.sniff import open_regular
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.text import short

if TYPE_CHECKING:
    from lxml import etree

    from terrainkit_robots.analysis.facts import Facts

_MOST_BODIES = 600
"""MuJoCo's compiler takes time with the third power of a chain: half a second for these."""

_MOST_BYTES = 32 * 2**20
"""Of all files that a robot names: some two seconds of convex hulls."""

_MOST_PIXELS = 4096 * 4096
"""Of one texture, whether it is read or made."""

_LARGEST_SIZE = 1_000
"""Of what <size> asks for: user data of every element, and keyframes, are allocated."""

_MOST_PLACES = 20_000
"""So many places are looked at for files."""

_NOT_TRUSTED = frozenset({"XML001", "XML010"})
"""Problems of documents that another parser might take for something else."""

_COSTLY = frozenset({"replicate", "composite", "flexcomp", "plugin", "extension", "skin", "flex"})
"""Elements that make others, or run code that comes from elsewhere."""

_FOLDERS = frozenset({"meshdir", "texturedir", "assetdir"})

_SIGNATURE = b"\x89PNG\r\n\x1a\n"


class NotTriedError(Exception):
    """Raised where a file is not given to a reader; says why."""


@dataclass(frozen=True, kw_only=True)
class Refusal:
    """Why a reader does not load a file."""

    words: str
    """Its own words, on one line."""

    element: str = ""
    """Name of the element that it points at, if it does."""


def refused_by_mujoco(facts: "Facts") -> Refusal | None:
    """Return why MuJoCo does not compile the file; None if it does.

    Raises:
        NotTriedError: if the file is not given to it.
    """
    model = facts.model
    if model.kind == "xacro":
        raise NotTriedError("MuJoCo reads no xacro, and the text that it expands to has no file")
    if len(model.links) > _MOST_BODIES:
        raise NotTriedError(f"MuJoCo is not asked about more than {_MOST_BODIES} bodies")
    _check_cost(model.sources)
    import mujoco

    try:
        with quiet_mujoco():
            mujoco.MjModel.from_xml_path(str(model.file))
    except (ValueError, RuntimeError, mujoco.FatalError, mujoco.UnexpectedError) as error:
        return _mujoco_words(str(error))
    return None


def refused_by_yourdfpy(facts: "Facts") -> Refusal | None:
    """Return why yourdfpy does not load the file; None if it does. No meshes are opened.

    Raises:
        NotTriedError: if the file is not given to it.
    """
    model = facts.model
    if model.kind != "urdf":
        raise NotTriedError("the text that xacro expands to has no file for yourdfpy to read")
    if len(model.links) + len(model.joints) > MAX_ELEMENTS:
        raise NotTriedError(f"yourdfpy is not asked about more than {MAX_ELEMENTS} elements")
    if facts.tree.cycles:
        raise NotTriedError("yourdfpy is not asked about a circle of links")
    document = parse_xml(model.file, _data(model.file))
    if document.root is None or any(p.code in _NOT_TRUSTED for p in document.problems):
        raise NotTriedError("yourdfpy is not given what is not well-formed, or defines entities")
    from lxml import etree

    data = etree.tostring(document.root)
    import yourdfpy

    log = logging.getLogger("yourdfpy")
    level = log.level
    log.setLevel(logging.CRITICAL + 1)
    try:
        yourdfpy.URDF.load(io.BytesIO(data), load_meshes=False, load_collision_meshes=False)
    except MemoryError:
        raise
    except Exception as error:  # it raises whatever its parts do
        words = " ".join(str(error).split()) or "nothing more is said"
        return Refusal(words=short(f"{type(error).__name__}: {words}", 200))
    finally:
        log.setLevel(level)
    return None


def _mujoco_words(error: str) -> Refusal:
    """Return the first line that says something, without what is only a heading."""
    lines = [re.sub(r"^(XML )?Error:\s*", "", line.strip()) for line in error.splitlines()]
    said = next((line for line in lines if line and not line.startswith("Element ")), "no reason")
    named = re.search(r"Element name '([^']*)'", error)
    return Refusal(words=short(" ".join(said.split()), 200), element=named[1] if named else "")


# What it would cost


def _data(path: Path) -> bytes:
    try:
        return read_bytes(path)
    except RobotFileError as error:
        raise NotTriedError(str(error)) from None


def _check_cost(sources: tuple[Path, ...]) -> None:
    """Look at all that MuJoCo would open and make.

    Raises:
        NotTriedError: if that could be too much.
    """
    elements, folders, names = 0, {Path()}, set[str]()
    for source in sources:
        root = parse_xml(source, _data(source)).root
        for element in () if root is None else root.iter():
            if not isinstance(element.tag, str):
                continue
            elements += 1
            if elements > MAX_ELEMENTS:
                raise NotTriedError(f"MuJoCo is not asked about more than {MAX_ELEMENTS} elements")
            _check_element(element)
            folders |= {Path(v) for k, v in element.attrib.items() if k in _FOLDERS}
            names |= {v for k, v in element.attrib.items() if k.startswith("file") and v}
    beside = {source.parent for source in sources}
    if len(names) * len(beside) * len(folders) > _MOST_PLACES:
        raise NotTriedError("it names more files and folders than are looked at")
    _check_files({path for name in names for path in _places(name, beside, folders)})


def _check_element(element: "etree._Element") -> None:
    tag = str(element.tag)
    if tag in ("include", "model"):
        return  # the file that it names is looked at as well
    if tag in _COSTLY or not harmless(tag):
        raise NotTriedError(f"a file with <{tag}> is not given to MuJoCo")
    attributes = {str(name): str(value) for name, value in element.attrib.items()}
    for name, text in attributes.items():
        if (not harmless(tag, name) and name != "user") or "octree" in name:
            raise NotTriedError(f"<{tag} {name}=...> is not given to MuJoCo")
        allocated = tag == "size" and (name.startswith("nuser") or name == "nkey")
        if allocated and _number(text) > _LARGEST_SIZE:
            raise NotTriedError(f"<size {name}={short(text, 20)!r}> is not given to MuJoCo")
    if tag == "texture":
        sides = [_number(attributes.get(name, "1")) for name in ("width", "height")]
        if max(sides) * max(sides) > _MOST_PIXELS:
            raise NotTriedError("a texture as large as that is not given to MuJoCo")


def _number(text: str) -> float:
    """Return the size of a number; what is none is endless."""
    try:
        return abs(float(text))
    except ValueError:
        return float("inf")


def _places(name: str, beside: set[Path], folders: set[Path]) -> Iterator[Path]:
    """Yield where MuJoCo could look for a file: below each folder, with its own folders or not."""
    bare = re.split(r"[/\\]", name)[-1]
    for written in {name, bare, re.sub(r"^\w+:/+", "", name)}:
        for folder in folders:
            yield from (base / folder / written for base in beside)


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
            raise NotTriedError(f"{path.name} is not given to MuJoCo: {error}") from None
        if head.startswith(_SIGNATURE):
            width, height = (int.from_bytes(head[k : k + 4], "big") for k in (16, 20))
            if width * height > _MOST_PIXELS:
                raise NotTriedError(f"{path.name} has too many pixels to be given to MuJoCo")
        if size > _MOST_BYTES:
            raise NotTriedError(f"its meshes have more than {_MOST_BYTES:,} bytes")
