import os

import mujoco
import numpy as np
import pytest

from terrainkit.errors import HeightFileError, TerrainkitWarning
from terrainkit.importing.height_source import open_source
from terrainkit.importing.import_options import ReadOptions
from tests.rays import cast_rays

SCENE = """
<mujoco>
  <asset>
    <hfield name="h" nrow="4" ncol="5" size="1 0.8 0.5 0.1"
      elevation="0 1 2 3 4  1 5 2 7 0  3 1 4 1 5  9 2 6 5 3"/>
    <mesh name="m" vertex="0 0 0  1 0 0  0 1 0  0 0 1" scale="0.7 0.7 0.7"/>
    <mesh name="robot" file="missing.obj"/>
  </asset>
  <worldbody>
    <geom type="plane" size="0 0 1" pos="0 0 0.1" euler="0 2 0"/>
    <geom type="box" size="0.5 0.3 0.2" pos="3 0 0.5" euler="10 20 30"/>
    <geom type="cylinder" size="0.4 0.3" pos="5 0 0.2"/>
    <geom type="capsule" size="0.3 0.4" pos="0 3 0.5" euler="0 70 0"/>
    <geom type="sphere" size="0.5" pos="3 3 0"/>
    <geom type="ellipsoid" size="0.5 0.8 0.4" pos="5 3 0" euler="0 0 40"/>
    <geom type="box" size="0.5 0.3 9" pos="0 0 0" contype="0" conaffinity="0"/>
    <body pos="0 0 0.3" euler="0 0 30"><geom type="hfield" hfield="h"/></body>
    <body pos="0 -3 0.3"><geom type="mesh" mesh="m"/></body>
    <body name="robot" pos="0 0 5"><freejoint/><geom type="mesh" mesh="robot"/></body>
  </worldbody>
</mujoco>
"""


def save(folder, text):
    (folder / "scene.xml").write_text(text)
    return folder / "scene.xml"


def test_scene_has_the_heights_of_rays(tmp_path):
    with pytest.warns(TerrainkitWarning, match="bodies with joints are left out: robot$"):
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


ROBOT = """
<mujoco>
  <asset>
    <material name="red"/>
    <hfield name="missing" file="missing.png" size="1 1 1 1"/>
  </asset>
  <worldbody>
    <geom name="floor" type="box" size="1 1 1"/>
    <site name="start" material="red"/>
    <light mode="targetbody" target="trunk"/>
    <camera mode="targetbodycom" target="leg"/>
    <body name="post"><geom size="0.1"/><light mode="targetbodycom" target="leg"/></body>
    <body name="trunk">
      <freejoint/><geom name="trunk" size="0.1"/><site name="trunk"/>
      <body name="leg" pos="1 0 0"><joint name="knee"/><geom type="hfield" hfield="missing"/></body>
    </body>
  </worldbody>
  <custom><tuple name="a"><element objtype="body" objname="trunk"/></tuple></custom>
  <contact><exclude body1="post" body2="leg"/><pair geom1="floor" geom2="trunk"/></contact>
  <tendon>
    <spatial name="a" material="red"><site site="start"/><site site="trunk"/></spatial>
    <fixed name="b"><joint joint="knee" coef="1"/></fixed>
  </tendon>
  <equality>
    <weld body1="post" body2="leg"/><weld site1="start" site2="trunk"/>
    <joint joint1="knee"/><tendon tendon1="b"/>
  </equality>
  <sensor><framepos objtype="body" objname="trunk"/><gyro site="trunk"/></sensor>
  <actuator><position joint="knee"/></actuator>
  <keyframe><key qpos="0 0 0 1 0 0 0 0"/></keyframe>
</mujoco>
"""


@pytest.mark.filterwarnings("ignore:.*bodies with joints")
def test_scene_may_refer_to_its_robot(tmp_path):
    heights = open_source(save(tmp_path, ROBOT), ReadOptions()).heights(np.zeros(1), np.zeros(1))
    assert heights == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<mujoco/>", "got a scene without ground"),
        ("<sdf/>", "got the root <sdf>; expected <mujoco>"),
        ("<mujoco><include file='other.xml'/></mujoco>", "other.xml: no file"),
        (SCENE.replace("0 2 0", "0 90 0").replace("freejoint", "inertial"), "cannot be read"),
        (SCENE.replace("0 2 0", "0 90 0"), "expected one that faces up"),
    ],
)
@pytest.mark.filterwarnings("ignore:.*bodies with joints")
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
    [
        ("", '<flexcomp name="f" type="grid" count="2000 2000 900" spacing=".1 .1 .1"/>', ""),
        ("", '<body><composite type="cable" count="1000000 1 1" size="1"/></body>', ""),
        ('<texture type="2d" builtin="flat" width="90000" height="90000"/>', "", ""),
        ('<texture type="2d" file="pipe.stl"/><skin file="pipe.stl"/>', "", ""),
        ("", "", '<size memory="900G"/><custom><numeric size="2000000000"/></custom>'),
    ],
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
