from types import SimpleNamespace
from unittest.mock import Mock

import mujoco
import numpy as np
import pytest

from terrainkit_robots.rendering.appearance import (
    SUN_DIRECTION,
    add_caption,
    make_renderer,
    set_appearance,
    update_scene,
)

OTHER = """<mujoco>
<asset><texture type="skybox" builtin="gradient" rgb1="1 0 0" width="8" height="8"/></asset>
<worldbody><light pos="0 0 9"/><geom size="1"/><geom size="2"/></worldbody></mujoco>"""


@pytest.fixture
def model():
    spec = mujoco.MjSpec.from_string(OTHER)
    set_appearance(spec)
    return spec.compile()


def test_appearance_replaces_lights_and_sky(model):
    assert (model.nlight, model.ntex) == (2, 1)
    sky = model.tex_data.reshape(-1, 3)
    np.testing.assert_allclose(sky / 255, np.tile([0.94, 0.955, 0.97], (len(sky), 1)), atol=4e-3)
    np.testing.assert_allclose(model.light_dir, [[0, 0, -1], SUN_DIRECTION], atol=1e-3)
    np.testing.assert_allclose(model.light_pos, -10 * model.light_dir, atol=1e-2)
    assert model.light_castshadow.tolist() == [False, True]
    assert (model.light_type == mujoco.mjtLightType.mjLIGHT_DIRECTIONAL).all()
    for found, levels in (
        (model.light_ambient, [0.45, 0]),
        (model.light_diffuse, [0.15, 0.5]),
        (model.light_specular, [0, 0.08]),
    ):
        np.testing.assert_allclose(found, np.tile(levels, (3, 1)).T)


def test_appearance_has_fog_and_fine_shadows(model):
    visual = model.vis
    assert visual.rgba.fog.tolist() == pytest.approx([0.94, 0.955, 0.97, 1])
    assert (visual.headlight.active, visual.global_.fovy) == (0, 30)
    quality, ranges = visual.quality, visual.map
    assert (quality.shadowsize, quality.offsamples, quality.numslices) == (2048, 4, 64)
    assert (ranges.znear, ranges.zfar) == pytest.approx((0.02, 400))
    assert (ranges.fogstart, ranges.fogend, ranges.shadowclip) == (2, 5.5, 1)


def test_renderer_has_the_size_and_no_haze(model, monkeypatch):
    scene = SimpleNamespace(flags={})
    make = Mock(return_value=SimpleNamespace(scene=scene))
    monkeypatch.setattr(mujoco, "Renderer", make)
    make_renderer(model, (160, 96), 2.5)
    make.assert_called_once_with(model, 96, 160, max_geom=1060)
    offscreen = model.vis.global_
    assert (model.stat.extent, offscreen.offwidth, offscreen.offheight) == (2.5, 160, 96)
    assert scene.flags == {mujoco.mjtRndFlag.mjRND_FOG: 1, mujoco.mjtRndFlag.mjRND_HAZE: 0}


def test_scene_has_the_camera_and_a_sun_above_the_target():
    calls, sun = [], SimpleNamespace(pos=None)
    renderer = SimpleNamespace(
        scene=SimpleNamespace(lights=[None, sun], nlight=2),
        model=SimpleNamespace(stat=SimpleNamespace(extent=3.0)),
        update_scene=lambda *arguments: calls.append(arguments),
    )
    options = update_scene(renderer, "data", np.array([1.0, 2, 3]), 4.0, 128.0, -16.0)
    ((data, camera, given),) = calls
    assert (data, given) == ("data", options)
    assert (camera.lookat.tolist(), camera.distance) == ([1, 2, 3], 4)
    assert (camera.azimuth, camera.elevation) == (128, -16)
    assert not options.sitegroup.any()
    assert not options.flags[mujoco.mjtVisFlag.mjVIS_RANGEFINDER]
    np.testing.assert_allclose(sun.pos, [1, 2, 3] - 6 * SUN_DIRECTION)


@pytest.mark.parametrize("scale", [0.5, 1.0])
def test_caption_is_dark_with_a_light_outline_in_the_corner(scale):
    frame = np.full((200, 300, 3), 128, np.uint8)
    add_caption(frame, "HH", scale)
    rows, columns = np.nonzero((frame != 128).any(axis=2))
    # The text starts at 20 pixels, and ends 30 pixels above the lower edge.
    assert columns.min() == pytest.approx(20 * scale, abs=4)
    assert rows.max() == pytest.approx(200 - 30 * scale, abs=3)
    assert rows.min() == pytest.approx(200 - 52 * scale, abs=4)
    assert frame.reshape(-1, 3).min(axis=0).tolist() == [50, 60, 70]
    assert frame.reshape(-1, 3).max(axis=0).tolist() == [238, 242, 247]
