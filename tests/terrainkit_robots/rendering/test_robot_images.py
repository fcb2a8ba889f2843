import re
from itertools import product

import cv2
import mujoco
import numpy as np
import pytest

from terrainkit_robots.rendering import robot_images
from terrainkit_robots.rendering.appearance import FIELD_OF_VIEW
from terrainkit_robots.rendering.child_process import RenderError
from terrainkit_robots.rendering.robot_images import (
    FILL_RATIO,
    VIEWS,
    fit_camera,
    render_robot,
    render_views,
    show_robot_geoms,
)
from tests.robots import QUADRUPED

SIZE = (144, 120)
QUADRUPED_MJCF = QUADRUPED.with_suffix(".xml")
CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))


@pytest.fixture(scope="module")
def red(tmp_path_factory):
    """Return pictures of the bundled quadruped in red; skips where MuJoCo cannot render."""
    text = QUADRUPED_MJCF.read_text()
    file = tmp_path_factory.mktemp("robot") / "robot.xml"
    file.write_text(re.sub(r'(<material [^>]*rgba=)"[^"]*"', r'\1"1 0 0 1"', text))
    try:
        pictures = dict(render_robot(file, size=SIZE))
    except RenderError as error:
        pytest.skip(str(error))
    assert [each.name for each in file.parent.iterdir()] == ["robot.xml"]  # and no log
    return {
        name: cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR).astype(int)
        for name, data in pictures.items()
    }


def test_render_robot_fills_each_view(red):
    assert list(red) == ["front", "side", "corner"]
    for picture in red.values():
        assert picture.shape == (SIZE[1], SIZE[0], 3)
        robot = picture[:, :, 2] - picture[:, :, 1] > 60
        rows, columns = np.flatnonzero(robot.any(axis=1)), np.flatnonzero(robot.any(axis=0))
        assert robot.mean() > 0.05
        assert rows[0] > 1
        assert rows[-1] < SIZE[1] - 2
        assert columns[0] > 1
        assert columns[-1] < SIZE[0] - 2
        filled = max(np.ptp(rows) / SIZE[1], np.ptp(columns) / SIZE[0])
        assert 0.75 < filled < 0.96


def test_render_robot_draws_light_floor_with_shadow(red):
    for picture in red.values():
        floor = picture[abs(picture[:, :, 2] - picture[:, :, 1]) < 20]
        assert np.median(floor) > 220
        assert 0.01 < (floor.mean(axis=1) < 170).mean() < 0.4


def world(content):
    return f"<mujoco><worldbody>{content}</worldbody></mujoco>"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (world(""), r"robot\.xml has no geoms to render"),
        (world('<geom type="plane" size="1 1 1"/>'), "no geoms to render"),
        (world('<geom size="1" pos="1e9 0 0"/>'), "more than 1000 m from the origin"),
        ("<mujoco", "XML"),
        (world('<geom type="mesh" mesh="m"/>'), "mesh"),
    ],
)
def test_robot_images_rejects_model(tmp_path, text, message):
    (tmp_path / "robot.xml").write_text(text)
    with pytest.raises(RenderError, match=message):
        next(render_views(tmp_path / "robot.xml", SIZE))


def test_render_robot_does_not_retry_after_rejected_model(tmp_path, monkeypatch):
    (tmp_path / "robot.xml").write_text(world(""))
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    with pytest.raises(RenderError, match=r"^robot\.xml has no geoms to render$"):
        dict(render_robot(tmp_path / "robot.xml"))


def compiled(content):
    material = "<asset><material name='glass' rgba='1 1 1 0'/></asset>"
    floor = f"<geom name='{robot_images.FLOOR}' type='plane' size='1 1 1'/>"
    return mujoco.MjModel.from_xml_string(
        f"<mujoco>{material}<worldbody>{floor}{content}</worldbody></mujoco>"
    )


def body(*geoms):
    shapes = "".join(f'<geom name="{name}" size="1" {rest}/>' for name, rest in geoms)
    return f"<body><freejoint/>{shapes}</body>"


HIDDEN = 'group="3"'


FLOOR = '<geom name="floor" type="plane" size="1 1 1"/>'
VISUAL, CLEAR = ("visual", ""), ("clear", 'rgba="1 1 1 0"')


@pytest.mark.parametrize(
    ("content", "shown"),
    [
        (body(("visual", 'group="2"'), ("collision", HIDDEN)), "visual"),
        (body(VISUAL, ("a", HIDDEN)) + body(("b", HIDDEN)), "visual"),
        (body(("a", HIDDEN)) + body(("b", HIDDEN)), "a b"),
        (FLOOR + body(VISUAL), "visual"),
        (FLOOR, ""),
        ('<geom name="base" size="1"/>' + body(VISUAL), "base visual"),
        (body(CLEAR, VISUAL), "visual"),
        (body(("glass", 'material="glass"'), VISUAL), "visual"),
        # The colors of geoms override materials.
        (body(("painted", 'material="glass" rgba="1 0 0 1"'), VISUAL), "painted visual"),
    ],
)
def test_geoms_of_the_robot_are_shown(content, shown):
    model = compiled(content)
    assert " ".join(model.geom(int(i)).name for i in show_robot_geoms(model)) == shown


def test_show_robot_geoms_colors_transparent_robot():
    model = compiled(body(CLEAR, ("glass", 'material="glass"')))
    assert show_robot_geoms(model).tolist() == [1, 2]
    assert (model.geom_rgba[1:, 3] == 1).all()
    assert model.geom_group.tolist() == [0, 0, 0]


def project(points, view, aspect):
    """Return image coordinates of points, from -1 to 1, and their depth."""
    target, distance = fit_camera(points, *view, aspect)
    a, e = np.radians(view)
    forward = np.array([np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e)])
    right = np.array([np.sin(a), -np.cos(a), 0])
    offset = points - (target - distance * forward)
    depth, half = offset @ forward, np.tan(np.radians(FIELD_OF_VIEW) / 2)
    up = np.cross(right, forward)
    return offset @ right / (depth * half * aspect), offset @ up / (depth * half), depth


@pytest.mark.parametrize("sides", [(1, 1, 1), (1, 0.1, 0.1), (0.1, 0.1, 1), (1, 1, 0)])
@pytest.mark.parametrize("view", VIEWS.values(), ids=VIEWS)
def test_fit_camera_fills_picture(sides, view):
    for size, aspect in product((0.01, 0.05, 3.0, 100.0), (0.5, 1, 2)):
        x, y, depth = project(CORNERS * size * sides + [5, -3, 0.5], view, aspect)
        assert depth.min() > 0
        assert max(abs(x).max(), abs(y).max()) == pytest.approx(FILL_RATIO, rel=0.05)


def test_fit_camera_of_point_keeps_distance():
    target, distance = fit_camera(np.array([[1.0, 2, 3]]), 0, 0, 1)
    assert distance > 0
    np.testing.assert_allclose(target, [1, 2, 3])


@pytest.mark.parametrize(("radius", "cell"), [(0.25, 0.1), (0.5, 0.2), (1.3, 0.5), (25, 10)])
def test_grid_spacing_is_round_number(radius, cell):
    assert robot_images.grid_spacing(radius) == cell
