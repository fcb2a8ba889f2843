import sys
from dataclasses import replace
from unittest.mock import MagicMock

import imageio_ffmpeg
import mujoco
import numpy as np
import pytest

from terrainkit.errors import ConfigError, ExportError
from terrainkit_robots.rendering import video
from terrainkit_robots.rendering.appearance import set_appearance
from terrainkit_robots.rendering.child_process import RenderError
from terrainkit_robots.rendering.video import (
    Shot,
    VideoSpec,
    check_video_path,
    cut_heightfields,
    prepare_model,
    smooth_path,
    video_frames,
    visible_area,
    write_video,
)

cv2 = pytest.importorskip("cv2")
SIZE = (160, 96)
ROWS, COLS = 21, 31
ROBOT = '<body pos="{x} 0 0.6"><freejoint/><geom size="0.1" rgba="1 0 0 1"/></body>'


def make_spec(ground, poses_shape=(1, 1), shots=None):
    """Return a video of a red ball on the ground."""
    text = f"<mujoco><worldbody>{ground}{ROBOT.format(x=0)}</worldbody></mujoco>"
    robot = mujoco.MjSpec.from_string(text)
    set_appearance(robot)
    model = robot.compile()
    poses = np.tile(model.qpos0, (*poses_shape, 1)).astype(np.float32)
    shots = shots or (Shot(robot=0, captions=("",)),)
    return VideoSpec(model=model, poses=poses, shots=shots, fps=25.0, size=SIZE)


@pytest.fixture(scope="module")
def spec():
    """Return a video of three robots on a checkered slope: each moves 1.4 m along x."""
    tiles = "".join(
        f'<geom type="box" size="0.5 0.5 0.5" pos="{x} {y} -0.5" rgba="{c} {c} {c} 1"/>'
        for x in range(-6, 7)
        for y in range(-6, 7)
        for c in [0.4 + 0.2 * ((x + y) % 2)]
    )
    shots = (
        Shot(robot=0, captions=("first",) * 6),
        Shot(robot=1, captions=("",)),
        Shot(robot=1, captions=("second",)),
    )
    spec = make_spec(tiles, (8, 3), shots)
    spec.poses[:, 1, 1] += 1
    spec.poses[:, 2, 0] += 500  # so far away that it is not rendered
    spec.poses[:, :, 0] += np.linspace(0, 1.4, 8)[:, None]
    return spec


@pytest.fixture(scope="module")
def frames(spec, tmp_path_factory):
    """Return the frames of the video; skips where MuJoCo cannot render."""
    path = tmp_path_factory.mktemp("video") / "video.mp4"
    try:
        assert list(write_video(spec, path)) == list(range(8))
    except RenderError as error:
        pytest.skip(str(error))
    assert [each.name for each in path.parent.iterdir()] == ["video.mp4"]
    return read(path)


def read(path):
    reader = cv2.VideoCapture(str(path))
    assert reader.get(cv2.CAP_PROP_FPS) == 25
    frames = []
    while (result := reader.read())[0]:
        frames.append(result[1])
    return np.array(frames).astype(int)


def test_write_video_centers_robot(frames):
    assert frames.shape == (8, SIZE[1], SIZE[0], 3)
    for frame in frames[:6]:
        blue, green, red = frame[SIZE[1] // 2, SIZE[0] // 2]
        assert red > green + 60
        assert red > blue + 60


def test_write_video_fades_ground_into_sky(frames):
    for frame in frames:
        top, bottom = frame[: SIZE[1] // 12].mean(), frame[2 * SIZE[1] // 3 :].mean()
        assert top > 200
        assert bottom < top - 20


@pytest.mark.parametrize("name", ["video.avi", "video", "video.mp4.png"])
def test_check_video_path_rejects_other_suffix(tmp_path, name):
    with pytest.raises(ConfigError, match=r"expected a name that ends in \.mp4"):
        check_video_path(tmp_path / name)
    (tmp_path / "video.mp4").touch()
    check_video_path(tmp_path / "video.mp4", overwrite=True)
    with pytest.raises(ExportError, match="exists"):
        check_video_path(tmp_path / "video.mp4")


@pytest.mark.parametrize("size", [(62, 96), (161, 96), (160, 4098), (-2, 96)])
def test_video_spec_rejects_size(spec, size):
    replace(spec, size=(64, 4096))
    with pytest.raises(ConfigError, match="expected two even numbers from 64 to 4096"):
        replace(spec, size=size)
    with pytest.raises(ConfigError, match="got 0; expected 1 or more"):
        replace(spec, shots=())


def test_write_video_without_backend_leaves_no_file(spec, tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "executable", "/bin/false")
    with pytest.raises(RenderError, match="the process crashed, exit code 1"):
        list(write_video(spec, tmp_path / "video.mp4"))
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def scenes(monkeypatch):
    """Record the camera of each scene and the places of the other robots."""
    recorded, renderer = [], MagicMock()
    renderer.__enter__.return_value.render = lambda: np.zeros((*SIZE[::-1], 3), np.uint8)

    def update_scene(_, data, *camera):
        np.testing.assert_allclose(data.geom_xpos[-1], data.qpos[:3])
        recorded.append((camera, [], data.qpos[0]))

    def add_geoms(_, data, *__):
        np.testing.assert_allclose(data.geom_xpos[-1], data.qpos[:3])
        recorded[-1][1].append(float(data.qpos[0]))

    monkeypatch.setattr(video.appearance, "make_renderer", lambda *_: renderer)
    monkeypatch.setattr(video.appearance, "update_scene", update_scene)
    monkeypatch.setattr(mujoco, "mjv_addGeoms", add_geoms)
    return recorded


def test_frames_show_the_robot_and_the_nearest_others(scenes):
    spec = make_spec("", (1, 30))
    spec.poses[0, :, 0] = [0, *np.linspace(1.5, 1, 26), 13.9, 14.1, 0.5]
    list(video_frames(spec))
    nearest = [0.5, *np.linspace(1.5, 1, 26)[:2:-1]]  # 24 robots
    assert scenes[0][1] == pytest.approx(nearest)
    few = make_spec("", (1, 3))
    few.poses[0, :, 0] = [0, 14.1, 13.9]
    list(video_frames(few))
    assert scenes[1][1] == pytest.approx([13.9])


def test_camera_swings_around_the_robot(scenes):
    spec = make_spec("", (60, 1), (Shot(robot=0, captions=("",) * 60),))
    spec.poses[:, 0, 0] = np.linspace(0, 6, 60)
    assert len(list(video_frames(spec))) == 60
    x = [(target[0], place) for (target, *_), _, place in scenes]
    np.testing.assert_allclose(x, np.tile(spec.poses[:, 0, 0], (2, 1)).T, atol=1e-5)
    distances, azimuths, elevations = np.array([camera[1:] for camera, *_ in scenes]).T
    assert set(distances) == {8 * 0.1}  # the radius of the robot
    assert set(elevations) == {-16}
    np.testing.assert_allclose(azimuths, 128 + 10 * np.sin(0.4 * np.arange(60) / 25))


def test_prepare_model_lowers_coplanar_boxes_and_shows_the_robot():
    box = '<geom type="box" size="1 1 1"/>'
    ball = '<body pos="0 0 0.6"><freejoint/><geom pos="0 0 0.2" size="0.1" group="{}"/></body>'
    for group, shown in ((1, 1), (2, 2), (3, 0)):
        text = f"<mujoco><worldbody>{33 * box}{ball.format(group)}</worldbody></mujoco>"
        model = mujoco.MjModel.from_xml_string(text)
        assert prepare_model(model) == pytest.approx(8 * 0.3)
        assert model.geom_group.tolist() == [0] * 33 + [shown]
        expected = [*np.arange(31) * -1e-4, 0, -1e-4, 0.2]
        np.testing.assert_allclose(model.geom_pos[:, 2], expected, atol=1e-9)


def test_visible_area_by_hand():
    """The camera looks along azimuths of 128 +- (10 + 25.47) deg: 92.53, 110.27, ..., 163.47."""
    targets = np.array([[1.0, 2, 0], [3, 2, 0]])
    lower, upper = visible_area(targets, 2.0, (640, 360))
    cos, sin = np.cos(np.radians(163.47)), np.sin(np.radians(92.53))
    np.testing.assert_allclose(lower, [1 + 11 * cos, 2 - 2.4 * sin], atol=2e-3)
    np.testing.assert_allclose(upper, [3 - 2.4 * cos, 2 + 11 * sin], atol=2e-3)


@pytest.fixture
def gray_frames(monkeypatch):
    """Replace the rendered frames by gray ones."""
    frames = [np.full((SIZE[1], SIZE[0], 3), 100, np.uint8)] * 8
    monkeypatch.setattr(video, "stream_frames", lambda _: iter(frames))


# imageio_ffmpeg leaves the pipe of a failed process to the garbage collector.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.usefixtures("gray_frames")
def test_write_video_reports_failing_ffmpeg(spec, tmp_path, monkeypatch):
    monkeypatch.setattr(imageio_ffmpeg._io, "get_ffmpeg_exe", lambda: "/bin/false")
    path = tmp_path / "video.mp4"
    with pytest.raises(ExportError, match=r"video\.mp4 cannot be encoded by ffmpeg: "):
        list(write_video(spec, path))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("gray_frames")
def test_write_video_reports_missing_frames(spec, tmp_path, monkeypatch):
    monkeypatch.setattr(imageio_ffmpeg, "count_frames_and_secs", lambda _: (7, 1.0))
    with pytest.raises(ExportError, match="7 of 8 frames are in the file"):
        list(write_video(spec, tmp_path / "video.mp4"))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("gray_frames")
def test_write_video_closed_early_leaves_no_file(spec, tmp_path):
    frames = write_video(spec, tmp_path / "video.mp4")
    next(frames)
    frames.close()
    assert list(tmp_path.iterdir()) == []


def test_smooth_path_keeps_line_and_removes_jitter():
    path = np.zeros((100, 3), np.float32)
    path[:, 0] = np.linspace(0, 6, 100)
    path[:, 2] = 0.3 + 0.05 * (-1.0) ** np.arange(100)
    smooth = smooth_path(path, 8.0)
    assert smooth.shape == path.shape
    np.testing.assert_allclose(smooth[:, 0], path[:, 0], atol=1e-4)
    assert np.ptp(smooth[25:-25, 2]) < 1e-3
    assert smooth_path(path[:1], 8.0).shape == (1, 3)


def make_hfield(attributes="", body="<body>{}</body>"):
    geom = f'<geom name="ground" type="hfield" hfield="hill" {attributes}/>'
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><asset><hfield name="hill" nrow="{ROWS}" ncol="{COLS}" size="3 2 1 0.1"/></asset>'
        f"<worldbody>{body.format(geom)}</worldbody></mujoco>"
    )
    model.hfield_data[:] = np.random.default_rng(1).random(ROWS * COLS)
    return model


def ground_heights(model, xy):
    """Return the height of the ground under points by ray casting, NaN where there is none."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    heights = np.full(len(xy), np.nan)
    down, hit = np.array([0.0, 0, -1]), np.zeros(1, np.int32)
    for k, (x, y) in enumerate(xy):
        depth = mujoco.mj_ray(model, data, np.array([x, y, 9.0]), down, None, 1, -1, hit, None)
        heights[k] = 9 - depth if depth >= 0 else np.nan
    return heights


@pytest.mark.parametrize("attributes", ["", 'pos="0.3 -0.2 0.5"'])
@pytest.mark.parametrize("body", ["{}", '<body pos="0.2 0.1 0">{}</body>'])
def test_cut_heightfields_keeps_heights(attributes, body):
    model = make_hfield(attributes, body)
    points = np.random.default_rng(0).uniform((-0.9, -0.5), (1.1, 1.3), (100, 2))
    before = ground_heights(model, points)
    assert not np.isnan(before).any()
    cropped = cut_heightfields(model, points.min(axis=0), points.max(axis=0))
    np.testing.assert_allclose(ground_heights(cropped, points), before, atol=1e-6)
    assert cropped.hfield_ncol[0] < 15
    assert cropped.hfield_nrow[0] < 15
    assert np.isnan(ground_heights(cropped, np.array([[2.5, 0.0], [0.0, -1.8]]))).all()
    assert (model.hfield_nrow[0], model.hfield_ncol[0]) == (ROWS, COLS)


def test_cut_heightfields_of_everything_changes_nothing():
    model = make_hfield()
    cropped = cut_heightfields(model, np.full(2, -90.0), np.full(2, 90.0))
    np.testing.assert_array_equal(cropped.hfield_data, model.hfield_data)
    np.testing.assert_array_equal(cropped.hfield_size, model.hfield_size)
    np.testing.assert_allclose(cropped.geom_pos, model.geom_pos, atol=1e-9)


@pytest.mark.parametrize("at", [(50.0, 0.0), (-50.0, -50.0), (0.0, 1.99)])
def test_cut_heightfields_keeps_one_cell(at):
    cropped = cut_heightfields(make_hfield(), np.array(at), np.array(at))
    assert cropped.hfield_nrow[0] >= 2
    assert cropped.hfield_ncol[0] >= 2
    assert (cropped.hfield_size[0] > 0).all()


def test_cut_heightfields_skips_rotated():
    cropped = cut_heightfields(make_hfield('euler="0 0 40"'), *np.zeros((2, 2)))
    assert (cropped.hfield_nrow[0], cropped.hfield_ncol[0]) == (ROWS, COLS)
