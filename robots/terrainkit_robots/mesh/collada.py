"""Read the triangles of a COLLADA file with pycollada.

The file is not trusted: its size and structure are checked before pycollada sees it. `up_axis` is
ignored on purpose: RViz, MoveIt and trimesh ignore it, and robots are modeled to look right without
it.
"""

import warnings
from io import BytesIO
from typing import Any

import numpy as np
from lxml import etree

from terrainkit_robots.mesh.surface import Faces, MeshError, Points, Surface, triangulate_fan

_MAX_TAGS = 500_000
"""Parsing a tag takes about a hundred times its length in memory."""

_MAX_NODES = 20_000
"""Nodes of a scene, each instance counted."""

_MAX_INSTANCE_NODES = 1000
"""pycollada needs time with the square of the nodes that refer to others."""

_MAX_SIZE = 6_000_000
"""Vertices, and faces, of a scene, each instance counted."""

_READ = {"asset", "library_geometries", "library_nodes", "library_visual_scenes", "scene"}
"""Elements below the root that hold the geometry."""

_REMOVED = ("bind_material", "extra", "instance_camera", "instance_controller", "instance_light")
"""Elements inside of `_READ` that do not matter for the geometry."""


def read_dae(data: bytes) -> Surface:
    """Return the triangles of a COLLADA file, in meters.

    All instances of the visual scene are included, or all geometries if the file has no scene.
    Skinned meshes are not supported.

    Raises:
        MeshError: If the file is malformed, too large, or has no geometry.
    """
    import collada

    root = _parse(data)
    _keep_geometry(root)
    content = etree.tostring(root)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # pycollada: np.matrix; NumPy 2.5: setting a shape
            # numpy.fromstring: text that is not a number
            warnings.filterwarnings("error", "string or file could not be read to its end")
            document = collada.Collada(
                BytesIO(content), ignore=[collada.common.DaeUnsupportedError]
            )
            return _read_scene(document)
    except MeshError:
        raise
    except Exception as error:  # pycollada raises many types
        reason = getattr(error, "msg", f"{type(error).__name__}: {error}")
        raise MeshError(f"cannot be read: {reason}") from None


def _parse(data: bytes) -> "etree._Element":
    """Return the root element of a file whose size and structure are safe."""
    if data.count(b"<") > _MAX_TAGS:
        raise MeshError(f"has more than {_MAX_TAGS:,} tags")
    if b"<!ENTITY" in data or b"<!DOCTYPE" in data:
        raise MeshError("has a document type declaration, which COLLADA does not use")
    # huge_tree: the numbers of one mesh may exceed libxml2's limit for a text
    parser = etree.XMLParser(
        resolve_entities=False,
        no_network=True,
        load_dtd=False,
        huge_tree=True,
        remove_comments=True,
        remove_pis=True,
    )
    try:
        root = etree.fromstring(data, parser)
    except (etree.XMLSyntaxError, ValueError) as error:
        raise MeshError(f"is not well-formed XML: {error}") from None
    if len(list(root.iter("{*}instance_node"))) > _MAX_INSTANCE_NODES:
        raise MeshError(f"has more than {_MAX_INSTANCE_NODES:,} instances of nodes")
    if any("nan" in (array.text or "").lower() for array in root.iter("{*}float_array")):
        raise MeshError("has vertices that are not numbers")  # pycollada replaces NaN by 0
    return root


def _keep_geometry(root: "etree._Element") -> None:
    """Remove what does not matter for the geometry, and complete what pycollada requires."""
    for child in list(root):
        if etree.QName(child).localname not in _READ:
            root.remove(child)
    for child in root.findall("{*}asset/*"):
        if etree.QName(child).localname != "unit":
            child.getparent().remove(child)
    etree.strip_elements(root, *(f"{{*}}{name}" for name in _REMOVED), with_tail=False)
    for accessor in root.iter("{*}accessor"):
        if not len(accessor):  # pycollada requires the names of the components
            for name in "ST" if accessor.get("stride") == "2" else "XYZ":
                etree.SubElement(accessor, accessor.tag.replace("accessor", "param"), name=name)


def _read_scene(document: Any) -> Surface:
    unit = document.assetInfo.unitmeter or 1.0
    if not 0 < unit < np.inf:
        raise MeshError(f"has the unit {unit} m")
    scene = document.scene or next(iter(document.scenes), None)
    if scene is None:
        instances = (geometry.bind(np.eye(4), {}) for geometry in document.geometries)
    else:
        counts: dict[int, int] = {}
        if sum(_count_nodes(node, counts) for node in scene.nodes) > _MAX_NODES:
            raise MeshError(f"has a scene of more than {_MAX_NODES:,} nodes")
        instances = scene.objects("geometry")
    points: list[Points] = []
    faces: list[Faces] = []
    n_points = n_faces = 0
    for instance in instances:
        for primitive in instance.primitives():
            triangles = _triangles(primitive)
            if triangles is None:
                continue
            points.append(primitive.vertex)
            faces.append(triangles.astype(np.int64) + n_points)
            n_points += len(primitive.vertex)
            n_faces += len(triangles)
            if max(n_points, n_faces) > _MAX_SIZE:
                raise MeshError(f"has more than {_MAX_SIZE:,} vertices or faces in its scene")
    if not points:
        raise MeshError("has no geometry")
    return Surface(
        points=np.concatenate(points).astype(np.float64) * unit, faces=np.concatenate(faces)
    )


def _count_nodes(node: Any, counts: dict[int, int]) -> int:
    """Return the number of nodes of a subtree, each instance counted."""
    target = getattr(node, "node", node)  # of an instance_node
    if id(target) not in counts:
        children = getattr(target, "children", ())
        counts[id(target)] = 1 + sum(_count_nodes(child, counts) for child in children)
    return counts[id(target)]


def _triangles(primitive: Any) -> Faces | None:
    """Return the faces of a bound primitive, shape (m, 3); None for lines and empty ones."""
    from collada.polylist import BoundPolylist
    from collada.triangleset import BoundTriangleSet

    indices: Faces | None = getattr(primitive, "vertex_index", None)
    if indices is None or not len(indices):
        return None
    if isinstance(primitive, BoundTriangleSet):
        return indices
    if not isinstance(primitive, BoundPolylist):
        return None
    counts = primitive.original.vcounts
    if (counts < 0).any() or counts.sum(dtype=np.int64) != len(indices):
        raise MeshError("has polygons whose vertex counts do not match their indices")
    return triangulate_fan(indices, counts)
