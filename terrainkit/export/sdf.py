"""Write the map as an SDF model for Gazebo, with an STL file for the ground beside it."""

from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

import numpy as np

from terrainkit.export.mesh_file import write_stl
from terrainkit.export.requirements import require_one_ground_friction
from terrainkit.geometry.mesh.solid_mesh import concatenate_meshes, solid_meshes
from terrainkit.geometry.solids import Solids, rotation_matrices
from terrainkit.settings.text import format_numbers

if TYPE_CHECKING:
    from terrainkit.map.terrain_map import TerrainMap

SUFFIXES = (".sdf",)
BYTES_PER_SAMPLE = 20


def export(terrain_map: "TerrainMap", path: Path) -> None:
    """Write a static model. Boxes and cylinders are shapes; hulls of one friction are one mesh.

    Args:
        terrain_map: The map.
        path: Target. The ground has the same name with the suffix .stl; the hulls of the k-th
            friction have _hulls_k.stl. Keep them in one folder.

    Raises:
        ExportError: if the ground has several friction coefficients.
    """
    require_one_ground_friction(terrain_map, "a mesh in SDF")
    contact = terrain_map.config.contact
    root = ET.Element("sdf", version="1.9")
    model = ET.SubElement(root, "model", name="terrain")
    ET.SubElement(model, "static").text = "true"
    link = ET.SubElement(model, "link", name="terrain")
    ground = path.with_suffix(".stl")
    write_stl(terrain_map.ground_mesh(), ground)
    _add_geometry(link, "ground", _mesh_geometry(ground), contact, contact["static_friction"])
    _add_shapes(link, terrain_map.solids, contact)
    _add_hulls(link, terrain_map.solids, contact, path)
    ET.indent(root)
    ET.ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)


def _mesh_geometry(path: Path) -> ET.Element:
    geometry = ET.Element("geometry")
    ET.SubElement(ET.SubElement(geometry, "mesh"), "uri").text = path.name
    return geometry


def _add_geometry(
    link: ET.Element,
    name: str,
    geometry: ET.Element,
    contact: dict[str, float],
    friction: float,
    *,
    pose: str = "",
    tags: tuple[str, ...] = ("collision", "visual"),
) -> None:
    """Add a geometry to the link as a collision shape, a visual shape, or both."""
    for tag in tags:
        element = ET.SubElement(link, tag, name=f"{name}_{tag}")
        if pose:
            ET.SubElement(element, "pose").text = pose
        element.append(geometry)
        if tag == "collision":
            surface = ET.SubElement(element, "surface")
            ode = ET.SubElement(ET.SubElement(surface, "friction"), "ode")
            ET.SubElement(ode, "mu").text = ET.SubElement(ode, "mu2").text = f"{friction:g}"
            bounce = ET.SubElement(surface, "bounce")
            ET.SubElement(bounce, "restitution_coefficient").text = f"{contact['restitution']:g}"


def _tags(solids: Solids, k: int) -> tuple[str, ...]:
    """Return the elements of a solid: collision if it collides, visual if it is visible."""
    flags = {"collision": solids.collides[k], "visual": solids.visible[k]}
    return tuple(tag for tag, is_set in flags.items() if is_set)


def _add_shapes(link: ET.Element, solids: Solids, contact: dict[str, float]) -> None:
    """Add the boxes and cylinders."""
    from scipy.spatial.transform import Rotation

    shapes = np.concatenate([solids.boxes, solids.cylinders]).astype(float)
    if not len(shapes):  # SciPy before 1.16 has no empty rotations
        return
    angles = Rotation.from_matrix(rotation_matrices(shapes[:, 6:])).as_euler("xyz")
    friction = np.where(np.isnan(solids.friction), contact["static_friction"], solids.friction)
    for k, (shape, rpy) in enumerate(zip(shapes, angles, strict=True)):
        geometry = ET.Element("geometry")
        if k < len(solids.boxes):
            size = ET.SubElement(ET.SubElement(geometry, "box"), "size")
            size.text = format_numbers(*(2 * shape[3:6]))
        else:
            cylinder = ET.SubElement(geometry, "cylinder")
            ET.SubElement(cylinder, "radius").text = format_numbers(shape[3])
            ET.SubElement(cylinder, "length").text = format_numbers(2 * shape[5])
        pose = format_numbers(*shape[:3], *rpy)
        tags = _tags(solids, k)
        _add_geometry(
            link, f"solid_{k}", geometry, contact, float(friction[k]), pose=pose, tags=tags
        )


def _add_hulls(link: ET.Element, solids: Solids, contact: dict[str, float], path: Path) -> None:
    """Add the hulls: one mesh for all hulls with the same friction and flags."""
    hulls = solids.select(solids.types == 2)
    meshes = list(solid_meshes(hulls))
    friction = np.where(np.isnan(hulls.friction), contact["static_friction"], hulls.friction)
    keys = list(
        zip(friction.tolist(), hulls.collides.tolist(), hulls.visible.tolist(), strict=True)
    )
    for number, key in enumerate(dict.fromkeys(keys)):
        members = [k for k, other in enumerate(keys) if other == key]
        file = path.with_name(f"{path.stem}_hulls_{number}.stl")
        write_stl(concatenate_meshes([meshes[k] for k in members]), file)
        tags = _tags(hulls, members[0])
        geometry = _mesh_geometry(file)
        _add_geometry(link, f"hulls_{number}", geometry, contact, key[0], tags=tags)
