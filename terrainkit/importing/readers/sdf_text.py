"""Translate a Gazebo world or model (SDF) to MJCF, whose reader has its shapes.

Models that are not static are left out. Files of other places are never fetched.
"""

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import HeightFileError, prefixed_errors
from terrainkit.importing.readers.height_source import check_file

if TYPE_CHECKING:
    from terrainkit.importing.readers.mjcf_text import MjcfText

_FOLDER_VARIABLES = ("GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH", "GAZEBO_MODEL_PATH")
"""Environment variables with the folders of models."""

_MAX_PARENTS = 5
"""Folders above a file in which the folder of a model may be."""

_SIZES: dict[str, dict[str, float]] = {
    "box": {"size": 0.5},
    "cylinder": {"radius": 1.0, "length": 0.5},
    "capsule": {"radius": 1.0, "length": 0.5},
    "sphere": {"radius": 1.0},
    "ellipsoid": {"radii": 1.0},
    "plane": {"size": 0.5},
    "mesh": {},
    "heightmap": {},
}
"""Shapes, and for each element with a part of their size its share in MJCF."""


class SdfReader:
    """Translates the models of a world."""

    def __init__(self, parse: Callable[[Path, tuple[Path, ...]], Any], scene: "MjcfText") -> None:
        """Create a reader.

        Args:
            parse: Returns the root of a document; its second argument are the documents around it.
            scene: Gets the files of the world, and the models that are left out.
        """
        from lxml.etree import SubElement

        self._parse, self._scene = parse, scene
        self._add = SubElement

    def translate(self, root: Any, path: Path) -> Any:
        """Return the MJCF scene of a document, whose meshes and heightfields have names only.

        Raises:
            HeightFileError: if an included model or a file is missing, or not supported.
        """
        from lxml.etree import Element

        scene = Element("mujoco")
        self._add(scene, "compiler", angle="radian", eulerseq="XYZ")
        self._assets = self._add(scene, "asset")
        world = self._add(scene, "worldbody")
        for part in root:
            # A model on its own is ground unless it has joints.
            is_static = part.tag == "model" and part.find("joint") is None
            states = {state.get("name"): state for state in part.findall("state/model")}
            for model in part if part.tag == "world" else [part]:
                state = states.get(model.get("name"), model)
                self._add_model(world, model, (path,), is_static, state.find("pose"))
        return scene

    def _add_model(
        self, parent: Any, model: Any, files: tuple[Path, ...], is_static: bool, pose: Any
    ) -> None:
        """Add a model or an included one to a body.

        Args:
            parent: The body.
            model: The model; other elements are ignored.
            files: The files around it, its own last.
            is_static: Whether a model around it is static.
            pose: Its pose, None for none.
        """
        is_static |= model.findtext("static", "").strip().lower() in ("true", "1")
        if model.tag == "include":
            self._include(parent, model, files, is_static)
        elif model.tag == "model" and is_static:
            body = self._add(parent, "body", _pose(pose))
            for child in model:
                self._add_model(body, child, files, True, child.find("pose"))
            for link in model.findall("link"):
                frame = self._add(body, "frame", _pose(link.find("pose")))
                for collision in link.findall("collision"):
                    self._add_collision(frame, collision, files[-1].parent)
        elif model.tag == "model":
            self._scene.moving.append(model.get("name", ""))

    def _include(self, parent: Any, include: Any, files: tuple[Path, ...], is_static: bool) -> None:
        uri, pose = include.findtext("uri", "").strip(), include.find("pose")
        name = uri.rstrip("/").rpartition("/")[2].lower().replace(" ", "_")
        if name == "ground_plane":
            body = self._add(parent, "body", _pose(pose))
            self._add(body, "geom", type="plane", size="50 50 1")
        if name == "ground_plane" or name.endswith("sun"):
            return
        path = find_file(uri, files[-1].parent)
        if path.is_dir():
            path = max(path.glob("*.sdf"), key=lambda file: file.name == "model.sdf", default=path)
        with prefixed_errors(f"{path.name}: "):
            for model in self._parse(path, files):
                model.set("name", include.findtext("name", model.get("name", "")))
                own = model.find("pose")
                place = own if pose is None else pose
                self._add_model(parent, model, (*files, path), is_static, place)

    def _add_collision(self, parent: Any, collision: Any, folder: Path) -> None:
        for shape in collision.findall("geometry/*"):
            if shape.tag == "empty":
                continue
            if shape.tag not in _SIZES:
                raise HeightFileError(f"got a <{shape.tag}>; expected {', '.join(_SIZES)}")
            frame = self._add(parent, "frame", _pose(collision.find("pose")))
            parts = _SIZES[shape.tag].items()
            size = np.concatenate([*(share * _numbers(shape, name) for name, share in parts), [1]])
            kind = shape.tag.replace("heightmap", "hfield")
            geom = self._add(frame, "geom", type=kind, size=_text(size[:3]))
            if shape.tag == "plane":
                geom.set("zaxis", shape.findtext("normal", "0 0 1"))
            elif shape.tag in ("mesh", "heightmap"):
                self._add_asset(geom, shape, folder)

    def _add_asset(self, geom: Any, shape: Any, folder: Path) -> None:
        """Add the file of a mesh or a heightmap."""
        file = find_file(shape.findtext("uri", "").strip(), folder)
        check_file(file)
        if shape.tag == "mesh":
            if shape.find("submesh") is not None:
                raise HeightFileError(f"got a submesh of {file.name}; expected whole meshes")
            scale = shape.findtext("scale", "1 1 1")
            name = f"{file} {scale}"
            if name not in self._scene.meshes:
                self._add(self._assets, "mesh", name=name, scale=scale)
            self._scene.meshes[name] = file
            geom.set("mesh", name)
        elif file.suffix.lower() in (".png", ".jpg", ".jpeg"):
            name = f"{file} {len(self._scene.images)}"
            sides = _numbers(shape, "size") * [0.5, 0.5, 1]
            self._add(self._assets, "hfield", name=name, size=f"{_text(sides)} 1e-3")
            self._scene.images[name] = file
            geom.set("hfield", name)
            geom.set("pos", shape.findtext("pos", "0 0 0"))
        else:
            raise HeightFileError(f"got the heightmap {file.name}; import it on its own")


def find_file(uri: str, folder: Path) -> Path:
    """Return the file or folder of a model that a URI names.

    Args:
        uri: A URI of Gazebo, such as model://name/mesh.dae, or a path.
        folder: Folder of the file that has it.

    Raises:
        HeightFileError: if it is not on this computer.
    """
    scheme, _, name = uri.rpartition("://")
    name = name if scheme in ("", "file") else name.lstrip("/")
    parents = [folder, *folder.absolute().parents[:_MAX_PARENTS]]
    folders = [place for parent in parents for place in (parent, parent / "models")]
    listed = os.pathsep.join(os.environ.get(variable, "") for variable in _FOLDER_VARIABLES)
    folders += map(Path, filter(None, listed.split(os.pathsep)))
    places = {"model": folders, "package": folders, "": [folder], "file": folders}
    for place in places.get(scheme, ()):
        if name and (place / name).exists():
            return place / name
    raise HeightFileError(
        f"{uri!r} is not here and not fetched; expected it beside the file, or in a folder of "
        f"{_FOLDER_VARIABLES[0]}"
    )


def _pose(pose: Any) -> dict[str, str]:
    """Return the attributes of a body with the pose of an element, which may be None or empty."""
    if pose is None or not (pose.text or "").strip():
        return {}
    frame = pose.get("relative_to", pose.get("frame", ""))  # older versions have `frame`
    if frame not in ("", "world", "__model__"):
        raise HeightFileError(f"got a pose relative to {frame}; expected one without")
    values = np.array(pose.text.split(), dtype=float)
    if pose.get("rotation_format") == "quat_xyzw":
        return {"pos": _text(values[:3]), "quat": _text(values[[6, 3, 4, 5]])}
    angles = np.radians(values[3:]) if pose.get("degrees") == "true" else values[3:]
    return {"pos": _text(values[:3]), "euler": _text(angles)}


def _numbers(element: Any, name: str) -> NDArray[np.float64]:
    return np.array(element.findtext(name, "1 1 1").split(), dtype=float)


def _text(values: Any) -> str:
    return " ".join(repr(float(value)) for value in values)
