"""Reduce an MJCF scene, or a Gazebo world, to what can be ground, before MuJoCo reads it.

MuJoCo opens every file that a scene names, also pipes and devices, and allocates what attributes
claim. Its parser needs quadratic time for bodies, and cubic time for the names of copies.
"""

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from terrainkit.errors import HeightFileError, prefixed_errors
from terrainkit.importing.readers.height_source import MAX_FILE_BYTES, check_file

MAX_ELEMENTS = 100_000
"""Most elements, copies included; MuJoCo needs seconds for this many."""

_WEIGHTS = {"body": 8, "frame": 8, "replicate": 8}
"""Number of elements that take MuJoCo as long as one of these."""

_MAX_FILES = 200
"""Most XML files of a scene."""

_MAX_SAMPLES = 1 << 24
"""Most samples of a heightfield."""

_UNUSED = """
actuator camera composite contact custom deformable equality extension flexcomp inertial keyframe
light material option plugin sensor site size skin statistic tendon texture visual
"""
_NOT_GROUND = frozenset(_UNUSED.split())
"""Elements that are left out."""


@dataclass
class MjcfText:
    """A scene in one text, whose meshes and heightfields have absolute paths."""

    text: str = ""

    models: dict[str, bytes] = field(default_factory=dict)
    """Contents of the attached models by file name."""

    meshes: dict[str, Path] = field(default_factory=dict)
    """Files of the meshes of a Gazebo world, by name."""

    images: dict[str, Path] = field(default_factory=dict)
    """Images of the heightmaps of a Gazebo world, by name."""

    moving: list[str] = field(default_factory=list)
    """Models of a Gazebo world that are left out."""

    num_bytes: int = 0
    """Size of the files that are read."""


def read_text(path: Path) -> MjcfText:
    """Return what can be ground in an MJCF scene.

    Raises:
        HeightFileError: if a file cannot be read, is special, such as a pipe, or too large.
    """
    reader = _Reader()
    with prefixed_errors(f"{path}: "):
        try:
            reader.scene.text, _ = reader.model(path, ())
        except (SyntaxError, ValueError, RecursionError) as error:
            raise HeightFileError(f"cannot be read: {error}") from error
    return reader.scene


class _Reader:
    def __init__(self) -> None:
        self.scene = MjcfText()
        self._num_files = 0

    def model(self, path: Path, parents: tuple[Path, ...]) -> tuple[str, int]:
        """Return the text of a model, and its number of elements, copies included."""
        from lxml import etree

        root = self._parse(path, parents)
        if root.tag == "sdf" and not parents:
            from terrainkit.importing.readers.sdf_text import SdfReader

            root = SdfReader(self._parse, self.scene).translate(root, path)
            files = {*self.scene.meshes.values(), *self.scene.images.values()}
            self.scene.num_bytes += sum(file.stat().st_size for file in files)
        if root.tag != "mujoco":
            raise HeightFileError(f"got the root <{root.tag}>; expected <mujoco> or <sdf>")
        self._include(root, path, path.parent, parents)
        _remove_unused(root)
        self._resolve_assets(root, path.parent)
        largest = 1
        for model in root.iter("model"):
            file = path.parent / model.get("file", "")
            with prefixed_errors(f"{file.name}: "):
                text, size = self.model(file, (*parents, path))
            model.set("file", f"attached_{len(self.scene.models)}.xml")
            self.scene.models[model.get("file")] = text.encode()
            largest = max(largest, size)
        size = _count_elements(root, {**_WEIGHTS, "attach": largest})
        return etree.tostring(root, encoding="unicode"), size

    def _parse(self, path: Path, parents: tuple[Path, ...]) -> Any:
        """Return the root of a document."""
        from lxml import etree

        if path in parents:
            raise HeightFileError("got a file that includes itself")
        check_file(path)
        self._num_files += 1
        self.scene.num_bytes += path.stat().st_size
        if self._num_files > _MAX_FILES or self.scene.num_bytes > MAX_FILE_BYTES:
            raise HeightFileError(f"got more than {_MAX_FILES} files or {MAX_FILE_BYTES} bytes")
        data = path.read_bytes()
        if b"<!DOCTYPE" in data:
            raise HeightFileError("got a document type; expected MJCF or SDF, which have none")
        if data.count(b"<") > 2 * MAX_ELEMENTS:
            raise HeightFileError(f"got a document of more than {MAX_ELEMENTS} elements")
        # In another encoding, the document type, and so entities, would have other bytes.
        parser = etree.XMLParser(
            encoding="utf-8", huge_tree=True, no_network=True, remove_comments=True, remove_pis=True
        )
        return etree.fromstring(data, parser)

    def _include(self, root: Any, path: Path, folder: Path, parents: tuple[Path, ...]) -> None:
        """Put the included documents in their places."""
        for include in [*root.iter("include")]:
            name = include.get("file", "")
            parent = include.getparent()
            file = folder / name if (folder / name).exists() else path.parent / name
            with prefixed_errors(f"{name}: "):
                part = self._parse(file, (*parents, path))
                self._include(part, file, folder, (*parents, path))
            position = parent.index(include)
            parent[position : position + 1] = part[:]

    def _resolve_assets(self, root: Any, folder: Path) -> None:
        """Check meshes and heightfields, and make the paths of their files absolute."""
        inner, is_stripped = "", False
        for compiler in root.iter("compiler"):
            inner = compiler.get("meshdir", compiler.get("assetdir", inner))
            is_stripped = compiler.get("strippath", str(is_stripped)).lower() == "true"
            for name in ("meshdir", "assetdir", "strippath", "discardvisual", "fusestatic"):
                compiler.attrib.pop(name, None)
        for asset in root.iter("mesh", "hfield"):
            samples = math.prod(int(asset.get(name, "0")) for name in ("nrow", "ncol"))
            if samples > _MAX_SAMPLES:
                expected = f"expected at most {_MAX_SAMPLES}"
                raise HeightFileError(f"got a heightfield of {samples} samples; {expected}")
            if name := asset.get("file"):
                file = folder / inner / (Path(name).name if is_stripped else name)
                asset.set("file", str(file.absolute()))
                if file.exists():  # those of a robot may be missing
                    check_file(file)
                    self.scene.num_bytes += file.stat().st_size


def _remove_unused(root: Any) -> None:
    """Remove what cannot be ground, and the names of copies."""
    copied = set()
    for element in [*root.iter()]:
        parent = element.getparent()
        if element.tag in _NOT_GROUND and parent is not None:
            parent.remove(element)
        if element.tag == "replicate" or parent in copied:
            copied.add(element)
        for name in {"material", "user", *(["name"] if element in copied else [])}:
            element.attrib.pop(name, None)


def _count_elements(root: Any, weights: Mapping[str, int]) -> int:
    """Return the number of elements, copies included."""
    sizes: Counter[Any] = Counter()
    for element in reversed([*root.iter()]):  # children before their parents
        size = sizes.pop(element, 0) + weights.get(element.tag, 1)
        if element.tag == "replicate":
            size *= max(1, int(element.get("count", "1")))
        if size > MAX_ELEMENTS:
            counted = "copies included, and each body or frame counted 8 times"
            raise HeightFileError(f"got more than {MAX_ELEMENTS} elements, {counted}")
        sizes[element.getparent()] += size
    return sizes[None]
