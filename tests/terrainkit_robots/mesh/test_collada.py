import numpy as np
import pytest

from terrainkit_robots.mesh.collada import read_dae
from terrainkit_robots.mesh.surface import MeshError

TRIANGLES = (
    '<triangles><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2 0 2 3</p></triangles>'
)


def geometry(faces=TRIANGLES, numbers="0 0 0 1 0 0 1 1 0 0 1 0", accessor='stride="3"', name="g"):
    return (
        f'<geometry id="{name}"><mesh><source id="p{name}"><float_array>{numbers}</float_array>'
        f"<technique_common><accessor {accessor}/></technique_common></source>"
        f'<vertices id="v"><input semantic="POSITION" source="#p{name}"/></vertices>{faces}</mesh>'
        "</geometry>"
    )


def dae(*geometries, scene="", rest="", unit=""):
    shown = f'<visual_scene id="s">{scene}</visual_scene>' if scene else ""
    text = (
        f'<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema"><asset>{unit}</asset>'
        f"<library_geometries>{''.join(geometries)}</library_geometries>{rest}"
        f"<library_visual_scenes>{shown}</library_visual_scenes>"
        '<scene><instance_visual_scene url="#s"/></scene></COLLADA>'
    )
    return text.encode()


SHOWN = '<instance_geometry url="#g"/>'


def triangles(data):
    surface = read_dae(data)
    return surface.points[surface.faces].tolist()


SQUARE = [[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]]


def test_a_square():
    assert triangles(dae(geometry(), scene=f"<node>{SHOWN}</node>")) == SQUARE


def test_without_a_scene_everything_is_there():
    assert triangles(dae(geometry(), geometry(name="h"))) == SQUARE * 2


def test_what_the_scene_does_not_show_is_not_there():
    data = dae(geometry(), geometry(name="h"), scene=f"<node>{SHOWN}</node>")
    assert triangles(data) == SQUARE


@pytest.mark.parametrize(
    "faces",
    [
        pytest.param(
            '<triangles><input semantic="NORMAL" offset="0"/><input semantic="VERTEX" offset="1"/>'
            "<p>9 0 9 1 9 2 9 0 9 2 9 3</p></triangles>",
            id="beside normals",
        ),
        pytest.param(
            '<polylist><input semantic="VERTEX" offset="0"/><vcount>4</vcount><p>0 1 2 3</p>'
            "</polylist>",
            id="polygons in a list",
        ),
        pytest.param(
            '<polygons><input semantic="VERTEX" offset="0"/><p>0 1 2</p><p>0 2 3</p></polygons>',
            id="polygons",
        ),
        pytest.param(
            '<trifans><input semantic="VERTEX" offset="0"/><p>0 1 2 3</p></trifans>', id="fans"
        ),
        pytest.param("<lines><p>0 1</p></lines>" + TRIANGLES, id="beside lines"),
    ],
)
def test_kinds_of_faces(faces):
    assert triangles(dae(geometry(faces))) == SQUARE


def test_strips_face_one_way():
    faces = '<tristrips><input semantic="VERTEX" offset="0"/><p>0 1 3 2</p></tristrips>'
    corners = np.array(triangles(dae(geometry(faces))))
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert normals.tolist() == [[0, 0, 1], [0, 0, 1]]


def test_accessors():
    numbers = "9 0 0 0 7 1 0 0 7 1 1 0 7 0 1 0 7"
    assert triangles(dae(geometry(numbers=numbers, accessor='stride="4" offset="1"'))) == SQUARE


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("<translate>1 2 3</translate>", [2, 2, 3]),
        ("<scale>2 3 4</scale>", [2, 0, 0]),
        ("<rotate>0 0 2 90</rotate>", [0, 1, 0]),
        ("<matrix>0 -1 0 5 1 0 0 6 0 0 1 7 0 0 0 1</matrix>", [5, 7, 7]),
        ("<translate>1 0 0</translate><scale>2 2 2</scale>", [3, 0, 0]),
    ],
)
def test_transforms(before, after):
    corner = read_dae(dae(geometry(), scene=f"<node>{before}{SHOWN}</node>")).points[1]
    assert corner == pytest.approx(after)


def test_nodes_in_nodes_and_instances_of_them():
    library = f'<library_nodes><node id="n"><scale>2 2 2</scale>{SHOWN}</node></library_nodes>'
    scene = '<node><translate>1 0 0</translate><node><instance_node url="#n"/></node></node>'
    surface = read_dae(dae(geometry(), rest=library, scene=scene * 2))
    assert len(surface.faces) == 4
    assert surface.points[1].tolist() == [3, 0, 0]


def test_skins():
    skin = '<controller id="c"><skin source="#g"/></controller>'
    rest = f"<library_controllers>{skin}</library_controllers>"
    scene = '<node><instance_controller url="#c"/></node>'
    assert triangles(dae(geometry(), rest=rest, scene=scene)) == SQUARE


def test_units_but_not_the_up_axis():
    unit = '<unit meter="0.001"/><up_axis>Y_UP</up_axis>'
    points = read_dae(dae(geometry(), unit=unit)).points
    assert points[2] == pytest.approx([0.001, 0.001, 0])


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        pytest.param(b"<COLLADA><a></COLLADA>", "not well-formed", id="not well-formed"),
        pytest.param(b"<COLLADA/>", "no geometry", id="empty"),
        pytest.param(
            b'<!DOCTYPE a [<!ENTITY l "ha">]><COLLADA>&l;</COLLADA>', "document type", id="entities"
        ),
        pytest.param(b"<COLLADA>" + b"<a/>" * 2_000_001 + b"</COLLADA>", "tags", id="many tags"),
        pytest.param(
            dae(geometry(), scene="<node>" * 5000 + SHOWN + "</node>" * 5000),
            "not well-formed",
            id="deep",
        ),
        pytest.param(
            dae(geometry(), scene='<node id="n"><instance_node url="#n"/></node>'),
            "one in itself",
            id="a node in itself",
        ),
        pytest.param(
            dae(
                geometry(TRIANGLES.replace("0 1 2 0 2 3", "0 1 2 " * 1000)),
                scene=f"<node>{SHOWN * 7000}</node>",
            ),
            "more than 6,000,000 corners or faces",
            id="many instances",
        ),
        pytest.param(dae(geometry(numbers="0 0 zero")), "text where numbers", id="words"),
        pytest.param(dae(geometry(accessor='stride="1"')), "positions of 1 numbers", id="stride"),
        pytest.param(dae(geometry(accessor='stride="1e300"')), "stride='1e300'", id="long stride"),
        pytest.param(dae(geometry(accessor='stride="-3"')), "stride='-3'", id="back stride"),
        pytest.param(
            dae(geometry(), scene=f"<node><matrix>1 2</matrix>{SHOWN}</node>"), "16", id="matrix"
        ),
        pytest.param(
            dae(geometry(), scene=f"<node><scale>1 nan 1</scale>{SHOWN}</node>"), "scale", id="nan"
        ),
        pytest.param(dae(geometry(), unit='<unit meter="inf"/>'), "meter='inf'", id="unit"),
        pytest.param(
            dae(geometry("<polylist><vcount>1000000000000 -4</vcount><p>0 1 2</p></polylist>")),
            "do not fit",
            id="counts",
        ),
        pytest.param(
            dae(geometry().replace("POSITION", "NORMAL")), "without positions", id="positions"
        ),
    ],
)
def test_broken_files(data, problem):
    with pytest.raises(MeshError, match=problem):
        read_dae(data)


def test_entities_of_other_files_are_not_read(tmp_path):
    secret = tmp_path / "secret"
    secret.write_text("1 2 3")
    data = f'<!DOCTYPE a [<!ENTITY s SYSTEM "{secret}">]>'.encode() + dae(geometry(numbers="&s;"))
    with pytest.raises(MeshError, match="document type"):
        read_dae(data)


@pytest.mark.parametrize("name", ["go2/dae/base.dae", "anymal_c/meshes/hatch.dae"])
def test_real_ones_against_somebody_elses_reader(robot_file, name):
    pytest.importorskip("collada")
    import trimesh

    path = robot_file(name)
    with np.errstate(all="ignore"):
        theirs = trimesh.load(path, force="mesh")
    surface = read_dae(path.read_bytes())
    ours = surface.points[surface.faces].reshape(-1, 3)
    assert len(surface.faces) == len(theirs.faces)
    assert np.allclose([ours.min(axis=0), ours.max(axis=0)], theirs.bounds, atol=1e-6)
