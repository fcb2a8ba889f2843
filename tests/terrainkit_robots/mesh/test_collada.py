import io
import zipfile

import numpy as np
import pytest

from terrainkit_robots.mesh.collada import read_dae
from terrainkit_robots.mesh.surface import MeshError
from tests.tables import read_table

TRIANGLES = (
    '<triangles><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2 0 2 3</p></triangles>'
)
XYZ = '<param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>'


def geometry(faces=TRIANGLES, numbers="0 0 0 1 0 0 1 1 0 0 1 0", params=XYZ, name="g"):
    return (
        f'<geometry id="{name}"><mesh><source id="p{name}"><float_array>{numbers}</float_array>'
        f"<technique_common><accessor>{params}</accessor></technique_common></source>"
        f'<vertices id="v"><input semantic="POSITION" source="#p{name}"/></vertices>{faces}</mesh>'
        "</geometry>"
    )


def dae(*geometries, scene="", rest="", unit=""):
    shown = f'<visual_scene id="s">{scene}</visual_scene>' if scene else ""
    reference = '<scene><instance_visual_scene url="#s"/></scene>' if scene else ""
    text = (
        f'<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema"><asset>{unit}</asset>'
        f"<library_geometries>{''.join(geometries)}</library_geometries>{rest}"
        f"<library_visual_scenes>{shown}</library_visual_scenes>"
        f"{reference}</COLLADA>"
    )
    return text.encode()


INSTANCE = '<instance_geometry url="#g"/>'
SCENE = f"<node>{INSTANCE}</node>"


def triangles(data):
    surface = read_dae(data)
    return surface.points[surface.faces].tolist()


SQUARE = [[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]]


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        pytest.param(dae(geometry(), scene=SCENE), SQUARE, id="scene"),
        pytest.param(dae(geometry(params="")), SQUARE, id="accessor without params"),
        pytest.param(dae(geometry(), rest="<library_images><image/></library_images>"), SQUARE),
        pytest.param(dae(geometry(), geometry(name="h")), SQUARE * 2, id="all without a scene"),
        pytest.param(dae(geometry(), geometry(name="h"), scene=SCENE), SQUARE, id="of a scene"),
    ],
)
def test_read_dae_triangles(data, expected):
    assert triangles(data) == expected


VERTEX = '<input semantic="VERTEX" source="#v" offset="0"/>'
NORMALS = '<input semantic="NORMAL" source="#pg" offset="0"/>' + VERTEX.replace("0", "1")


@pytest.mark.parametrize(
    "faces",
    [
        f"<triangles>{NORMALS}<p>1 0 1 1 1 2 1 0 1 2 1 3</p></triangles>",
        f"<polylist>{VERTEX}<vcount>4</vcount><p>0 1 2 3</p></polylist>",
        f"<polylist>{VERTEX}<vcount>2 4 1</vcount><p>0 1 0 1 2 3 2</p></polylist>",
        f"<polygons>{VERTEX}<p>0 1 2</p><p>0 2 3</p></polygons>",
        f"<trifans>{VERTEX}<p>0 1 2 3</p></trifans>",
        f"<lines>{VERTEX}<p>0 1</p></lines>{TRIANGLES}",
    ],
    ids=["with normals", "polylist", "degenerate polygons", "polygons", "fans", "with lines"],
)
def test_face_elements(faces):
    assert triangles(dae(geometry(faces))) == SQUARE


def test_strips_have_consistent_winding():
    faces = f"<tristrips>{VERTEX}<p>0 1 3 2</p></tristrips>"
    corners = np.array(triangles(dae(geometry(faces))))
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert normals.tolist() == [[0, 0, 1], [0, 0, 1]]


@pytest.mark.parametrize(("before", "after"), read_table(__file__, "transforms"))
def test_transforms(before, after):
    corner = read_dae(dae(geometry(), scene=f"<node>{before}{INSTANCE}</node>")).points[1]
    assert corner == pytest.approx(after, abs=1e-6)


def test_nested_nodes_and_instances():
    library = f'<library_nodes><node id="n"><scale>2 2 2</scale>{INSTANCE}</node></library_nodes>'
    scene = '<node><translate>1 0 0</translate><node><instance_node url="#n"/></node></node>'
    surface = read_dae(dae(geometry(), rest=library, scene=scene * 2))
    assert len(surface.faces) == 4
    assert surface.points[1].tolist() == [3, 0, 0]


def test_unit_is_applied_and_up_axis_ignored():
    unit = '<unit meter="0.001"/><up_axis>Y_UP</up_axis>'
    points = read_dae(dae(geometry(), unit=unit)).points
    assert points[2] == pytest.approx([0.001, 0.001, 0])


def zipped():
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr("a.dae", dae(geometry()))
    return stream.getvalue()


def nested_instances(levels, copies):
    """Return a library in which each node has several instances of the one before it."""
    nodes = [f'<node id="n0">{INSTANCE}</node>']
    for k in range(1, levels):
        inner = f'<instance_node url="#n{k - 1}"/>' * copies
        nodes.append(f'<node id="n{k}">{inner}</node>')
    return f"<library_nodes>{''.join(nodes)}</library_nodes>"


def scene(inside, **rest):
    return dae(geometry(), scene=f"<node>{inside}</node>", **rest)


DEEP = "<node>" * 5000 + INSTANCE + "</node>" * 5000
ENTITIES = b'<!DOCTYPE a [<!ENTITY l "ha">]><COLLADA>&l;</COLLADA>'
NODE = '<instance_node url="#n"/>'
COUNTS = f"<polylist>{VERTEX}<vcount>1000000000 -4</vcount><p>0 1 2</p></polylist>"
MANY = TRIANGLES.replace("0 1 2 0 2 3", "0 1 2 " * 1000)
FAR = TRIANGLES.replace('offset="0"', 'offset="999999999"')
NESTED = scene('<instance_node url="#n19"/>', rest=nested_instances(levels=20, copies=10))
ITSELF = dae(geometry(), scene=f'<node id="n">{NODE}</node>')
INSTANCES = dae(geometry(MANY), scene=f"<node>{INSTANCE * 7000}</node>")

BROKEN = {
    "not well-formed": (b"<COLLADA><a></COLLADA>", "not well-formed"),
    "empty": (b"<COLLADA/>", "no geometry"),
    "zip archive": (zipped(), "not well-formed"),
    "entities": (ENTITIES, "document type"),
    "many tags": (b"<COLLADA>" + b"<a/>" * 500_001 + b"</COLLADA>", "more than 500,000 tags"),
    "deep": (scene(DEEP), "not well-formed"),
    "a node in itself": (ITSELF, "Node #n not found"),
    "nested instances": (NESTED, "more than 20,000 nodes"),
    "many instances of nodes": (scene(NODE * 1001), "more than 1,000 instances"),
    "many instances": (INSTANCES, "more than 6,000,000 vertices or faces"),
    "words": (dae(geometry(numbers="0 0 zero")), "cannot be read"),
    "NaN": (dae(geometry(numbers="0 0 NaN")), "not numbers"),
    "index": (dae(geometry(TRIANGLES.replace("0 2 3", "0 2 9"))), "cannot be read"),
    "offset": (dae(geometry(FAR)), "cannot be read"),
    "matrix": (scene(f"<matrix>1 2</matrix>{INSTANCE}"), "Corrupted matrix"),
    "unit": (dae(geometry(), unit='<unit meter="inf"/>'), "unit inf m"),
    "counts": (dae(geometry(COUNTS)), "do not match"),
    "positions": (dae(geometry().replace("POSITION", "NORMAL")), "Bad vertices"),
}


@pytest.mark.parametrize(("data", "problem"), BROKEN.values(), ids=BROKEN)
def test_read_dae_rejects_broken_files(data, problem):
    with pytest.raises(MeshError, match=problem):
        read_dae(data)


def test_external_entities_are_rejected(tmp_path):
    secret = tmp_path / "secret"
    secret.write_text("1 2 3")
    data = f'<!DOCTYPE a [<!ENTITY s SYSTEM "{secret}">]>'.encode() + dae(geometry(numbers="&s;"))
    with pytest.raises(MeshError, match="document type"):
        read_dae(data)
