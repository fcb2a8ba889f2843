import imageio_ffmpeg
import mujoco
import numpy as np
import pytest

from terrainkit.errors import ConfigError, ExportError
from terrainkit_robots.rendering import child_process
from terrainkit_robots.rendering.child_process import RenderError
from terrainkit_robots.rendering.video import Shot, VideoSpec, check_video_path, write_video

cv2 = pytest.importorskip("cv2")
SIZE = (160, 96)
ROBOT = '<body pos="{x} 0 0.6"><freejoint/><geom size="0.1" rgba="1 0 0 1"/></body>'


def make_spec(ground, poses_shape=(1, 1), shots=None):
    """Return a video of a red ball on the ground."""
    text = f"<mujoco><worldbody>{ground}{ROBOT.format(x=0)}</worldbody></mujoco>"
    model = mujoco.MjModel.from_xml_string(text)
    poses = np.tile(model.qpos0, (*poses_shape, 1)).astype(np.float32)
    shots = shots or (Shot(robot=0, start=0, stop=1, captions=("",)),)
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
        Shot(robot=0, start=0, stop=6, captions=("first",) * 6),
        Shot(robot=1, start=2, stop=3, captions=("",)),
        Shot(robot=1, start=2, stop=3, captions=("second",)),
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


def test_write_video_writes_every_frame(frames):
    assert frames.shape == (8, SIZE[1], SIZE[0], 3)


def test_write_video_shows_motion(frames):
    assert frames[0].std() > 10
    assert np.abs(frames[5] - frames[0]).mean() > 1
    assert np.abs(frames[6] - frames[2]).mean() > 1  # another robot at the same time


def test_write_video_centers_robot(frames):
    for frame in frames[:6]:
        blue, green, red = frame[SIZE[1] // 2, SIZE[0] // 2]
        assert red > green + 60
        assert red > blue + 60


def test_write_video_fades_ground_into_sky(frames):
    for frame in frames:
        top, bottom = frame[: SIZE[1] // 12].mean(), frame[2 * SIZE[1] // 3 :].mean()
        assert top > 200
        assert bottom < top - 20


def test_write_video_draws_captions(frames):
    plain, captioned = frames[6:]  # otherwise the same
    changed = np.abs(captioned - plain).max(axis=2) > 25
    rows, columns = np.nonzero(changed)
    assert len(rows) > 5
    assert rows.min() > 0.8 * SIZE[1]
    assert columns.max() < 0.5 * SIZE[0]


def test_write_video_lights_coplanar_boxes_once(tmp_path):
    slab = '<geom type="box" size="9 9 0.5" pos="{} 0 -0.5"/>'
    frames = []
    for number, positions in enumerate([[0], [0, 1, -1]]):
        path = tmp_path / f"{number}.mp4"
        try:
            list(write_video(make_spec("".join(map(slab.format, positions))), path))
        except RenderError as error:
            pytest.skip(str(error))
        frames.append(read(path)[0])
    one, several = frames
    assert (several - one)[SIZE[1] // 2 :].max() < 25


def test_write_video_keeps_existing_file(spec, tmp_path):
    path = tmp_path / "video.mp4"
    path.write_bytes(b"mine")
    with pytest.raises(ExportError, match="exists"):
        next(write_video(spec, path))
    assert path.read_bytes() == b"mine"


@pytest.mark.parametrize("name", ["video.avi", "video", "video.mp4.png"])
def test_check_video_path_rejects_other_suffix(tmp_path, name):
    with pytest.raises(ConfigError, match=r"expected a name that ends in \.mp4"):
        check_video_path(tmp_path / name)


@pytest.mark.parametrize("size", [(0, 96), (161, 96), (160, 5000), (-2, 96)])
def test_video_spec_rejects_size(spec, size):
    with pytest.raises(ConfigError, match="expected two even numbers from 64 to 4096"):
        VideoSpec(model=spec.model, poses=spec.poses, shots=spec.shots, fps=25.0, size=size)


def test_video_spec_rejects_zero_frames(spec):
    with pytest.raises(ConfigError, match="got 0; expected 1 or more"):
        VideoSpec(model=spec.model, poses=spec.poses, shots=(), fps=25.0)


def test_write_video_without_backend_leaves_no_file(spec, tmp_path, monkeypatch):
    monkeypatch.setattr(child_process.sys, "executable", "/bin/false")
    with pytest.raises(RenderError, match=r"crashed \(exit code 1\)"):
        list(write_video(spec, tmp_path / "video.mp4"))
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def gray_frames(monkeypatch):
    """Replace the rendered frames by gray ones."""
    frames = [np.full((SIZE[1], SIZE[0], 3), 100, np.uint8)] * 8
    monkeypatch.setattr(child_process, "stream_frames", lambda _: iter(frames))


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
