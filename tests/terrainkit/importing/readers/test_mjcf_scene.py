import os

import mujoco
import numpy as np
import pytest

from terrainkit.errors import HeightFileError, TerrainkitWarning
from terrainkit.importing.readers.height_source import open_source
from terrainkit.importing.readers.import_options import ReadOptions
from tests.rays import cast_rays
from tests.tables import read_table

SCENE = read_table(__file__, "scene")


def save(folder, text):
    (folder / "scene.xml").write_text(text)
    return folder / "scene.xml"


def test_scene_has_the_heights_of_rays(tmp_path):
    with pytest.warns(TerrainkitWarning, match="bodies that move are left out: robot$"):
        source = open_source(save(tmp_path, SCENE), ReadOptions())
    # The reference without the robot, whose mesh is missing, and without what does not collide.
    lines = [line for line in SCENE.splitlines() if not {"robot", "contype"} & set(line.split('"'))]
    lines = [line for line in lines if "contype" not in line]
    model = mujoco.MjModel.from_xml_string("\n".join(lines))
    x, y = np.linspace(-1.97, 6.03, 40), np.linspace(-3.93, 4.07, 40)
    starts = np.stack([*np.meshgrid(x, y, indexing="ij"), np.full((40, 40), 9.0)], axis=-1)
    expected, _ = cast_rays(model, starts.reshape(-1, 3))
    found = source.heights(x, y).ravel()
    difference = np.abs(found - expected)
    is_beside = source.heights(x, y + 1e-2).ravel() - found  # steep sides amplify an error
    assert difference[np.abs(is_beside) < 5e-3].max() < 2e-3  # the sphere's faces
    assert np.median(difference) < 1e-6


ROBOT = read_table(__file__, "robot")


@pytest.mark.filterwarnings("ignore:.*bodies that move")
def test_scene_may_refer_to_its_robot(tmp_path):
    heights = open_source(save(tmp_path, ROBOT), ReadOptions()).heights(np.zeros(1), np.zeros(1))
    assert heights == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<mujoco/>", "got a scene without ground"),
        ("<sdf/>", "got a scene without ground"),
        ("<mujoco><include file='other.xml'/></mujoco>", "other.xml: no file"),
        (SCENE.replace("0 2 0", "0 90 0").replace("freejoint", "inertial"), "cannot be read"),
        (SCENE.replace("0 2 0", "0 90 0"), "expected one that faces up"),
    ],
)
@pytest.mark.filterwarnings("ignore:.*bodies that move")
def test_scene_without_ground_is_rejected(tmp_path, text, message):
    with pytest.raises(HeightFileError, match=rf"scene\.xml: .*{message}"):
        open_source(save(tmp_path, text), ReadOptions())


BOX = '<geom type="box" size="1 1 1"/>'
COPIES = '<replicate count="1000" offset="1 0 0">'


def scene(inside="", world=BOX, outside=""):
    asset = f"<asset>{inside}</asset>"
    return f"<mujoco>{outside}{asset}<worldbody>{world}</worldbody></mujoco>"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (scene('<mesh file="pipe.stl"/>'), "pipe.stl: got a special file or folder"),
        (scene('<hfield file="zero.png" size="1 1 1 1"/>'), "zero.png: got a special file"),
        (scene(outside='<include file="pipe.stl"/>'), "pipe.stl: got a special file"),
        (scene('<model name="m" file="pipe.stl"/>'), "pipe.stl: got a special file"),
        (scene(outside='<include file="scene.xml"/>'), "got a file that includes itself"),
        (scene('<model name="m" file="scene.xml"/>'), "got a file that includes itself"),
        (scene(world=COPIES.replace("1000", "1000000000") + BOX + "</replicate>"), "100000 elem"),
        (scene(world=3 * COPIES + BOX + 3 * "</replicate>"), "more than 100000 elements"),
        (scene(world=13_000 * "<body/>"), "more than 100000 elements"),
        (scene('<hfield nrow="30000" ncol="30000" size="1 1 1 1"/>'), "900000000 samples"),
        ("<!DOCTYPE a [<!ENTITY b 'c'>]>" + scene(), "got a document type"),
        (scene(world=3000 * "<body>" + 3000 * "</body>"), "cannot be read"),
    ],
)
def test_scene_that_claims_much_is_rejected_before_mujoco_reads_it(tmp_path, text, message):
    os.mkfifo(tmp_path / "pipe.stl")
    (tmp_path / "zero.png").symlink_to("/dev/zero")
    with pytest.raises(HeightFileError, match=message):
        open_source(save(tmp_path, text), ReadOptions())


@pytest.mark.parametrize(
    ("inside", "world", "outside"),
    read_table(__file__, "parts_of_a_scene_that_are_no_ground_are_not_read"),
)
def test_parts_of_a_scene_that_are_no_ground_are_not_read(tmp_path, inside, world, outside):
    os.mkfifo(tmp_path / "pipe.stl")
    source = open_source(save(tmp_path, scene(inside, BOX + world, outside)), ReadOptions())
    assert source.heights(np.zeros(1), np.zeros(1)) == pytest.approx(1.0)


def test_copies_and_attached_models_are_ground(tmp_path):
    (tmp_path / "part.xml").write_text(scene(world='<body name="b">' + BOX + "</body>"))
    world = '<replicate count="3" offset="4 0 0">' + BOX + "</replicate>"
    world += '<body pos="0 9 1"><attach model="part" body="b" prefix="p"/></body>'
    text = scene('<model name="part" file="part.xml"/>', world)
    source = open_source(save(tmp_path, text), ReadOptions())
    for x, y, z in ((0.0, 0.0, 1.0), (4.0, 0.0, 1.0), (8.0, 0.0, 1.0), (0.0, 9.0, 2.0)):
        assert source.heights(np.array([x]), np.array([y])) == pytest.approx(z)
    assert np.isnan(source.heights(np.array([2.0]), np.array([0.0])))


def test_robots_with_capsules_between_points_are_left_out(tmp_path):
    text = (
        '<mujoco><worldbody><geom type="box" size="2 2 0.1"/><body name="robot"><freejoint/>'
        '<geom type="capsule" fromto="0 0 0 0 0 1" size="0.1"/></body></worldbody></mujoco>'
    )
    with pytest.warns(TerrainkitWarning, match="left out: robot"):
        source = open_source(save(tmp_path, text), ReadOptions())
    assert source.heights(np.zeros(1), np.zeros(1)) == pytest.approx(0.1)
