"""Weigh meshes: give a MuJoCo spec the meshes of another one, as far as MuJoCo can compile them."""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import mujoco

from terrainkit_robots.description.mjcf.shapes import mesh_file, mesh_name
from terrainkit_robots.description.mjcf.tree import Node
from terrainkit_robots.files import open_regular
from terrainkit_robots.quiet_mujoco import quiet_mujoco

MAX_BYTES = 32 * 2**20
"""Size of all files that are weighed; MuJoCo needs about a second for them."""

_FORMATS = frozenset({".stl", ".obj", ".msh"})
"""Formats that MuJoCo reads without plugins."""


class MeshMasses:
    """The meshes of a parsed spec that a copy of it can be compiled with.

    Args:
        parsed: The parsed spec.
        copy: The spec that gets the meshes.
        node_of: Function that returns the node of a MuJoCo element.
        contents: File contents by path, which are used instead of files on disk.
    """

    def __init__(
        self, parsed: Any, copy: Any, node_of: Callable[[Any], Node], contents: Mapping[Path, bytes]
    ) -> None:
        self._parsed, self._copy, self._node_of = parsed, copy, node_of
        self._meshes = {mesh_name(mesh): mesh for mesh in parsed.meshes}
        self._contents, self._bytes = contents, 0
        self._added: dict[tuple[str, int], bool] = {}

    def add(self, place: Any, geom: Any, quat: Any) -> bool:
        """Add a geom that has the mass of a geom with a mesh; return whether MuJoCo weighs it.

        Args:
            place: The body or frame that it is added to.
            geom: The geom of the parsed spec.
            quat: Its orientation.
        """
        key = geom.meshname, int(geom.typeinertia)
        if key not in self._added:
            self._added[key] = self._add_mesh(geom)
        if self._added[key]:
            _add_geom(place, geom, geom.meshname, pos=geom.pos, quat=quat)
        return self._added[key]

    def _add_mesh(self, geom: Any) -> bool:
        """Add the mesh of a geom to the copy, unless MuJoCo rejects it."""
        name = geom.meshname
        mesh = self._meshes.get(name)
        data = None if mesh is None else self._data(mesh)
        if data is None:
            return False
        trial = mujoco.MjSpec()
        _write_mesh(trial, mesh, name, data)
        body = trial.worldbody.add_body()
        _add_geom(body, geom, name)
        body.add_freejoint()
        try:
            with quiet_mujoco():
                mass = float(trial.compile().body_mass[1])
        except (ValueError, RuntimeError, mujoco.FatalError, mujoco.UnexpectedError):
            return False
        if name not in {mesh.name for mesh in self._copy.meshes}:
            _write_mesh(self._copy, mesh, name, data)
        return 0 < mass < math.inf

    def _data(self, mesh: Any) -> dict[str, bytes] | None:
        """Return the file of a mesh, none if it has its points; None if it cannot be used."""
        file = mesh_file(mesh, self._node_of(mesh), bool(self._parsed.strippath))
        if file is None:
            return {} if len(mesh.uservert) else None
        suffix = file.path.suffix.lower()
        if suffix not in _FORMATS:
            return None
        data = self._contents.get(file.path)
        if data is None:
            try:
                with open_regular(file.path) as stream:
                    data = stream.read(MAX_BYTES - self._bytes + 1)
            except (OSError, ValueError):
                return None
        self._bytes += len(data)
        return {f"{len(self._copy.assets)}{suffix}": data} if self._bytes <= MAX_BYTES else None


def _write_mesh(spec: Any, mesh: Any, name: str, data: Mapping[str, bytes]) -> None:
    """Add a mesh to a spec, with the content of its file by name, or with its own points."""
    spec.assets = {**spec.assets, **data}
    spec.add_mesh(
        name=name,
        file=next(iter(data), ""),
        uservert=[] if data else mesh.uservert,
        userface=[] if data else mesh.userface,
        scale=mesh.scale,
        refpos=mesh.refpos,
        refquat=mesh.refquat,
        inertia=mesh.inertia,
    )


def _add_geom(place: Any, geom: Any, mesh: str, **pose: Any) -> None:
    place.add_geom(
        type=geom.type,
        meshname=mesh,
        mass=geom.mass,
        density=geom.density,
        typeinertia=geom.typeinertia,
        fitscale=geom.fitscale,
        contype=0,
        conaffinity=0,
        **pose,
    )
