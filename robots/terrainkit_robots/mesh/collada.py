"""Reading the triangles of a COLLADA file, through its scene, in meters.

`up_axis` is left out of account on purpose: RViz, MoveIt and trimesh do not turn a mesh by it, so
that robots are drawn to look right without it, whatever it says.
"""

from collections.abc import Iterator, Mapping

import numpy as np
from lxml import etree

from terrainkit_robots.mesh.surface import (
    Faces,
    MeshError,
    Points,
    Surface,
    parse_float_list,
    parse_int_list,
    triangulate_fan,
)
from terrainkit_robots.transforms import Matrix, axis_angle_to_matrix

_MOST_TAGS = 2_000_000
"""Of a file with more tags nothing is read: each takes a hundred times its length in memory."""

_MOST_NODES = 20_000
"""Nodes of a scene that are walked through; one that holds itself has no end."""

_MOST = 6_000_000
"""Corners, and faces, that a file may have once all its instances are made."""

_TRIANGLES = {"triangles": 3, "polylist": 0, "polygons": 0, "trifans": -1, "tristrips": -2}
"""Elements with faces, and how: corners of each, 0 for any number, below for fans and strips."""


def read_dae(data: bytes) -> Surface:
    """Return the triangles of a COLLADA file.

    Raises:
        MeshError: if it is not well-formed, or holds something that cannot be.
    """
    root = _parse(data)
    ids = {str(e.get("id")): e for e in root.iter("{*}*") if e.get("id") is not None}
    unit = _number(root.find("{*}asset/{*}unit"), "meter", 1.0)
    points: list[Points] = []
    faces: list[Faces] = []
    read: dict[str, Surface] = {}
    total = triangles = 0
    for name, pose in _instances(root, ids):
        if name not in read:
            read[name] = _geometry(ids[name], ids)
        part = read[name]
        faces.append(part.faces + total)
        points.append(part.points @ pose[:3, :3].T + pose[:3, 3])
        total += len(part.points)
        triangles += len(part.faces)
        if max(total, triangles) > _MOST:
            raise MeshError(f"has more than {_MOST:,} corners or faces in its scene")
    if not points:
        raise MeshError("holds no geometry")
    return Surface(points=np.concatenate(points) * unit, faces=np.concatenate(faces))


def _parse(data: bytes) -> "etree._Element":
    if data.count(b"<") > _MOST_TAGS:
        raise MeshError(f"has more than {_MOST_TAGS:,} tags")
    if b"<!ENTITY" in data or b"<!DOCTYPE" in data:
        raise MeshError("has a document type, which COLLADA has not")
    # huge_tree, because the numbers of one mesh may be longer than libxml2 lets a text be
    parser = etree.XMLParser(
        resolve_entities=False,
        no_network=True,
        load_dtd=False,
        huge_tree=True,
        remove_comments=True,
    )
    try:
        root = etree.fromstring(data, parser)
    except (etree.XMLSyntaxError, ValueError) as error:
        raise MeshError(f"is not well-formed XML: {error}") from None
    return root


def _instances(
    root: "etree._Element", ids: Mapping[str, "etree._Element"]
) -> Iterator[tuple[str, Matrix]]:
    """Yield the id of each geometry in the scene and its pose; all of them where there is none."""
    scene = _scene(root, ids)
    if scene is None:
        for geometry in root.iterfind("{*}library_geometries/{*}geometry[@id]"):
            yield str(geometry.get("id")), np.eye(4)
        return
    stack = [(scene, np.eye(4))]
    left = _MOST_NODES
    while stack:
        node, pose = stack.pop()
        left -= 1
        if left < 0:
            raise MeshError(f"has a scene of more than {_MOST_NODES:,} nodes, or one in itself")
        for child in node:
            if _tag(child) in _TRANSFORMS:
                pose = pose @ _transform(child)
            elif _tag(child) == "node":
                stack.append((child, pose))
            elif _tag(child) == "instance_node" and _target(child) in ids:
                stack.append((ids[_target(child)], pose))
            elif (name := _shown(child, ids)) in ids:
                yield name, pose


_TRANSFORMS = {"matrix": 16, "rotate": 4, "translate": 3, "scale": 3}
"""Elements that place a node, and how many numbers each has."""


def _scene(root: "etree._Element", ids: Mapping[str, "etree._Element"]) -> "etree._Element | None":
    shown = root.find("{*}scene/{*}instance_visual_scene")
    scene = ids.get(_target(shown)) if shown is not None else None
    return scene if scene is not None else root.find("{*}library_visual_scenes/{*}visual_scene")


def _shown(element: "etree._Element", ids: Mapping[str, "etree._Element"]) -> str:
    """Return the id of the geometry that an element of a node shows; empty for none."""
    if _tag(element) == "instance_geometry":
        return _target(element)
    controller = ids.get(_target(element)) if _tag(element) == "instance_controller" else None
    skin = controller.find("{*}skin") if controller is not None else None
    return "" if skin is None else str(skin.get("source", ""))[1:]


def _transform(element: "etree._Element") -> Matrix:
    values = parse_float_list((element.text or "").encode())
    wanted = _TRANSFORMS[_tag(element)]
    if values.size != wanted or not np.isfinite(values).all():
        raise MeshError(f"has a {_tag(element)} of {values.size} numbers where {wanted} are wanted")
    pose = np.eye(4)
    match _tag(element):
        case "matrix":
            return values.reshape(4, 4)
        case "translate":
            pose[:3, 3] = values
        case "scale":
            pose[:3, :3] = np.diag(values)
        case _:
            length = float(np.linalg.norm(values[:3]))
            if length > 0:
                pose[:3, :3] = axis_angle_to_matrix(values[:3] / length, np.radians(values[3]))
    return pose


def _geometry(geometry: "etree._Element", ids: Mapping[str, "etree._Element"]) -> Surface:
    mesh = geometry.find("{*}mesh")
    vertices = mesh.find("{*}vertices") if mesh is not None else None
    if mesh is None or vertices is None:
        return Surface(points=np.zeros((0, 3)), faces=np.zeros((0, 3), np.int64))
    points = _positions(vertices, ids)
    faces = [
        _faces(element, _TRIANGLES[_tag(element)])
        for element in mesh
        if _tag(element) in _TRIANGLES
    ]
    return Surface(
        points=points, faces=np.concatenate(faces) if faces else np.zeros((0, 3), np.int64)
    )


def _positions(vertices: "etree._Element", ids: Mapping[str, "etree._Element"]) -> Points:
    for given in vertices.iterfind("{*}input[@semantic='POSITION']"):
        source = ids.get(str(given.get("source", ""))[1:])
        array = source.find("{*}float_array") if source is not None else None
        if source is None or array is None:
            continue
        values = parse_float_list((array.text or "").encode())
        accessor = source.find("{*}technique_common/{*}accessor")
        stride = int(_number(accessor, "stride", 3))
        offset = int(_number(accessor, "offset", 0))
        if stride < 3:
            raise MeshError(f"has positions of {stride} numbers each")
        whole = values[offset:]
        return whole[: whole.size // stride * stride].reshape(-1, stride)[:, :3]
    raise MeshError("has a geometry without positions")


def _faces(element: "etree._Element", corners: int) -> Faces:
    inputs = element.findall("{*}input")
    width = 1 + max((int(_number(i, "offset", 0)) for i in inputs), default=0)
    offset = next(
        (int(_number(i, "offset", 0)) for i in inputs if i.get("semantic") == "VERTEX"), 0
    )
    lists = [_indices(p, width, offset) for p in element.iter("{*}p")]
    if not lists:  # nothing is drawn with it
        return np.zeros((0, 3), np.int64)
    if corners == -2:
        return np.concatenate([_strip(each) for each in lists])
    counts = np.array([len(each) for each in lists])
    indices = np.concatenate(lists)
    if corners == 3:
        return indices[: len(indices) // 3 * 3].reshape(-1, 3)
    vcount = element.find("{*}vcount")
    if vcount is not None:
        counts = parse_int_list((vcount.text or "").encode())
    if (counts < 0).any() or counts.sum() != len(indices):
        raise MeshError("has polygons whose counts do not fit their corners")
    return triangulate_fan(indices, counts)


def _indices(p: "etree._Element", width: int, offset: int) -> Faces:
    values = parse_int_list((p.text or "").encode())
    return values[: values.size // width * width].reshape(-1, width)[:, offset]


def _strip(indices: Faces) -> Faces:
    """Return the triangles of a strip, every second one turned to face as the others do."""
    triangles = np.stack([indices[:-2], indices[1:-1], indices[2:]], axis=1)
    triangles[1::2] = triangles[1::2, ::-1]
    return triangles


def _number(element: "etree._Element | None", name: str, default: float) -> float:
    text = element.get(name) if element is not None else None
    if text is None:
        return default
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not 0 <= value < _LARGEST:
        raise MeshError(f"has {name}={text!r:.40} where a number should be")
    return value


_LARGEST = 1e9
"""No count, unit or offset is larger."""


def _target(element: "etree._Element") -> str:
    return str(element.get("url", ""))[1:]


def _tag(element: "etree._Element") -> str:
    return element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""
