import cv2
import mujoco
import numpy as np
import trimesh

from terrainkit_robots.export.model_copy import copy_model
from tests.terrainkit_robots.export.made_models import stl_of

MJCF = """<mujoco><compiler meshdir="m" texturedir="t"/><asset>
  <mesh name="a" file="part.stl"/><mesh name="b" file="sub/part.stl"/>
  <mesh name="c" file="part.stl"/>
  <texture type="2d" name="t" file="t.png"/></asset><worldbody><include file="more/robot.xml"/>
  <geom type="mesh" mesh="a"/><geom type="mesh" mesh="b"/><geom type="mesh" mesh="c"/></worldbody>
</mujoco>"""


def test_copy_of_a_model_is_one_folder(tmp_path):
    """Files with the same name are kept apart, and an included file is part of the model."""
    for name, width in {"m/part.stl": 1, "m/sub/part.stl": 2}.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(stl_of(trimesh.creation.box([width, 1, 1])))
    for folder in ("t", "more", "copy"):
        (tmp_path / folder).mkdir()
    (tmp_path / "t/t.png").write_bytes(cv2.imencode(".png", np.zeros((2, 2, 3), np.uint8))[1])
    (tmp_path / "more/robot.xml").write_text('<x><body name="more"><geom size="3"/></body></x>')
    (tmp_path / "scene.xml").write_text(MJCF)
    files = copy_model(tmp_path / "scene.xml")
    assert set(files) == {"0_part.stl", "1_part.stl", "2_t.png", "robot.xml"}
    for name, data in files.items():
        (tmp_path / "copy" / name).write_bytes(data)
    before, copy = (
        mujoco.MjModel.from_xml_path(str(tmp_path / name))
        for name in ("scene.xml", "copy/robot.xml")
    )
    assert (copy.nmesh, copy.ntex) == (3, 1)
    np.testing.assert_allclose(copy.geom_size, before.geom_size, atol=1e-6)
