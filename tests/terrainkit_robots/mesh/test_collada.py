import io
import zipfile

import numpy as np
import pytest

from terrainkit_robots.mesh.collada import read_dae
from terrainkit_robots.mesh.surface import MeshError

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


def triangles(data):
    surface = read_dae(data)
    return surface.points[surface.faces].tolist()


SQUARE = [[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]]


def test_read_dae_triangles():
    assert triangles(dae(geometry(), scene=f"<node>{INSTANCE}</node>")) == SQUARE


def test_accessor_without_params():
    assert triangles(dae(geometry(params=""))) == SQUARE


def test_no_scene_includes_all_geometries():
    assert triangles(dae(geometry(), geometry(name="h"))) == SQUARE * 2


def test_geometry_outside_scene_is_ignored():
    data = dae(geometry(), geometry(name="h"), scene=f"<node>{INSTANCE}</node>")
    assert triangles(data) == SQUARE


VERTEX = '<input semantic="VERTEX" source="#v" offset="0"/>'


@pytest.mark.parametrize(
    "faces",
    [
        pytest.param(
            '<triangles><input semantic="NORMAL" source="#pg" offset="0"/>'
            '<input semantic="VERTEX" source="#v" offset="1"/>'
            "<p>1 0 1 1 1 2 1 0 1 2 1 3</p></triangles>",
            id="with normals",
        ),
        pytest.param(
            f"<polylist>{VERTEX}<vcount>4</vcount><p>0 1 2 3</p></polylist>", id="polylist"
        ),
        pytest.param(
            f"<polylist>{VERTEX}<vcount>2 4 1</vcount><p>0 1 0 1 2 3 2</p></polylist>",
            id="degenerate polygons",
        ),
        pytest.param(f"<polygons>{VERTEX}<p>0 1 2</p><p>0 2 3</p></polygons>", id="polygons"),
        pytest.param(f"<trifans>{VERTEX}<p>0 1 2 3</p></trifans>", id="fans"),
        pytest.param(f"<lines>{VERTEX}<p>0 1</p></lines>{TRIANGLES}", id="with lines"),
    ],
)
def test_face_elements(faces):
    assert triangles(dae(geometry(faces))) == SQUARE


def test_strips_have_consistent_winding():
    faces = '<tristrips><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 3 2</p></tristrips>'
    corners = np.array(triangles(dae(geometry(faces))))
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert normals.tolist() == [[0, 0, 1], [0, 0, 1]]


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("<translate>1 2 3</translate>", [2, 2, 3]),
        ("<scale>2 3 4</scale>", [2, 0, 0]),
        ("<rotate>0 0 1 90</rotate>", [0, 1, 0]),
        ("<matrix>0 -1 0 5 1 0 0 6 0 0 1 7 0 0 0 1</matrix>", [5, 7, 7]),
        ("<translate>1 0 0</translate><scale>2 2 2</scale>", [3, 0, 0]),
    ],
)
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


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        pytest.param(b"<COLLADA><a></COLLADA>", "not well-formed", id="not well-formed"),
        pytest.param(b"<COLLADA/>", "no geometry", id="empty"),
        pytest.param(zipped(), "not well-formed", id="zip archive"),
        pytest.param(
            b'<!DOCTYPE a [<!ENTITY l "ha">]><COLLADA>&l;</COLLADA>', "document type", id="entities"
        ),
        pytest.param(b"<COLLADA>" + b"<a/>" * 500_001 + b"</COLLADA>", "tags", id="many tags"),
        pytest.param(
            dae(geometry(), scene="<node>" * 5000 + INSTANCE + "</node>" * 5000),
            "not well-formed",
            id="deep",
        ),
        pytest.param(
            dae(geometry(), scene='<node id="n"><instance_node url="#n"/></node>'),
            "Node #n not found",
            id="a node in itself",
        ),
        pytest.param(
            dae(
                geometry(),
                rest=nested_instances(levels=20, copies=10),
                scene='<node><instance_node url="#n19"/></node>',
            ),
            "more than 20,000 nodes",
            id="nested instances",
        ),
        pytest.param(
            dae(geometry(), scene='<node><instance_node url="#n"/></node>' * 1001),
            "more than 1,000 instances",
            id="many instances of nodes",
        ),
        pytest.param(
            dae(
                geometry(TRIANGLES.replace("0 1 2 0 2 3", "0 1 2 " * 1000)),
                scene=f"<node>{INSTANCE * 7000}</node>",
            ),
            "more than 6,000,000 vertices or faces",
            id="many instances",
        ),
        pytest.param(dae(geometry(numbers="0 0 zero")), "cannot be read", id="words"),
        pytest.param(dae(geometry(numbers="0 0 NaN")), "not numbers", id="NaN"),
        pytest.param(
            dae(geometry(TRIANGLES.replace("0 2 3", "0 2 9"))), "cannot be read", id="index"
        ),
        pytest.param(
            dae(geometry(TRIANGLES.replace('offset="0"', 'offset="999999999"'))),
            "cannot be read",
            id="offset",
        ),
        pytest.param(
            dae(geometry(), scene=f"<node><matrix>1 2</matrix>{INSTANCE}</node>"),
            "Corrupted matrix",
            id="matrix",
        ),
        pytest.param(dae(geometry(), unit='<unit meter="inf"/>'), "unit inf m", id="unit"),
        pytest.param(
            dae(
                geometry(
                    '<polylist><input semantic="VERTEX" source="#v" offset="0"/>'
                    "<vcount>1000000000 -4</vcount><p>0 1 2</p></polylist>"
                )
            ),
            "do not match",
            id="counts",
        ),
        pytest.param(dae(geometry().replace("POSITION", "NORMAL")), "Bad vertices", id="positions"),
    ],
)
def test_read_dae_rejects_broken_files(data, problem):
    with pytest.raises(MeshError, match=problem):
        read_dae(data)


def test_external_entities_are_rejected(tmp_path):
    secret = tmp_path / "secret"
    secret.write_text("1 2 3")
    data = f'<!DOCTYPE a [<!ENTITY s SYSTEM "{secret}">]>'.encode() + dae(geometry(numbers="&s;"))
    with pytest.raises(MeshError, match="document type"):
        read_dae(data)


@pytest.mark.parametrize("name", ["go2/dae/base.dae", "anymal_c/meshes/hatch.dae"])
def test_real_files_match_trimesh(robot_file, name):
    import trimesh

    path = robot_file(name)
    with np.errstate(all="ignore"):
        theirs = trimesh.load(path, force="mesh")
    surface = read_dae(path.read_bytes())
    ours = surface.points[surface.faces].reshape(-1, 3)
    assert len(surface.faces) == len(theirs.faces)
    assert np.allclose([ours.min(axis=0), ours.max(axis=0)], theirs.bounds, atol=1e-6)
