import sys
from unittest.mock import MagicMock, Mock

import mujoco
import numpy as np
import pytest

from terrainkit_robots.rendering import pose_renderer as module
from terrainkit_robots.rendering.appearance import set_appearance
from terrainkit_robots.rendering.child_process import RenderError
from terrainkit_robots.rendering.pose_renderer import PoseRenderer

SIZE = (160, 96)
WORLD = """<mujoco>
<asset><hfield name="hill" nrow="601" ncol="601" size="30 30 1 0.1"/></asset>
<worldbody>
  <geom type="hfield" hfield="hill" pos="30 0 0"/>
  <body pos="0 0 0.6"><freejoint/><geom size="0.1" rgba="1 0 0 1"/></body>
</worldbody></mujoco>"""


@pytest.fixture
def renderer():
    spec = mujoco.MjSpec.from_string(WORLD)
    set_appearance(spec)
    renderer = PoseRenderer(spec.compile(), SIZE)
    yield renderer
    renderer.close()


def render(renderer, x):
    try:
        return renderer.render(np.array([x, 0, 0.6, 1, 0, 0, 0])).astype(int)
    except RenderError as error:
        pytest.skip(str(error))


def test_render_follows_robot_over_map(renderer):
    for x in (0.5, 1.0, 40.0):  # the last one is far outside of the first part of the map
        red, green, blue = np.moveaxis(render(renderer, x), 2, 0)
        is_robot = (red > green + 60) & (red > blue + 60)
        rows, columns = np.nonzero(is_robot)
        assert abs(rows.mean() - SIZE[1] / 2) < 5
        assert abs(columns.mean() - SIZE[0] / 2) < 5
        assert green[-10:].mean() < green[:10].mean() - 20  # ground and sky


def test_close_can_be_repeated_and_render_starts_again(renderer):
    first = render(renderer, 1.0)
    renderer.close()
    renderer.close()
    np.testing.assert_array_equal(render(renderer, 1.0), first)


def test_render_raises_each_time_without_backend(renderer, monkeypatch):
    monkeypatch.setattr(sys, "executable", "/bin/false")
    for _ in range(2):
        with pytest.raises(RenderError, match="cannot render here"):
            renderer.render(np.zeros(7))


def test_map_is_cut_again_after_2_m(monkeypatch):
    areas, renderers = [], [MagicMock() for _ in range(3)]
    make = Mock(side_effect=renderers)
    monkeypatch.setattr(
        module, "cut_heightfields", lambda model, *area: areas.append(area) or model
    )
    monkeypatch.setattr(module.appearance, "make_renderer", make)
    monkeypatch.setattr(module.appearance, "update_scene", lambda *_: None)
    model = mujoco.MjModel.from_xml_string(WORLD)
    places = ((0, 0), (1.99, -1.99), (2.01, 0), (2, 2.01))
    poses = [np.array([x, y, 0.6, 1, 0, 0, 0]) for x, y in places]
    assert len(list(module.pose_frames(model, SIZE, iter(poses)))) == 4
    assert [each.close.called for each in renderers] == [True, True, False]
    make.assert_called_with(model, SIZE, pytest.approx(0.48))
    # Seen from 8 times the radius of the robot in a video, and from 0.6 of that here.
    visible = module.visible_area(np.zeros((1, 3)), 0.6 * 8 * 0.1, SIZE)
    for (lower, upper), place in zip(areas, (places[0], *places[2:]), strict=True):
        np.testing.assert_allclose(lower, visible[0] + place - 2, atol=1e-6)
        np.testing.assert_allclose(upper, visible[1] + place + 2, atol=1e-6)
