import time
from pathlib import Path

import cv2
import mujoco
import numpy as np
import pytest

from terrainkit.errors import ConfigError, ExportError
from terrainkit_robots import gl_backend
from terrainkit_robots.onboarding.pictures import PicturesError
from terrainkit_robots.rl import video
from terrainkit_robots.rl.scene import build_scene
from terrainkit_robots.rl.video import Film, Shot, check_video, film_frames

SIZE = (160, 96)


@pytest.fixture(scope="module")
def film(quadruped, map_ground, calm):
    """Return a film of three robots on a map: each walks 6 m in a second, sideways to the other."""
    model = build_scene(quadruped, map_ground, calm()).model
    home = np.array(model.qpos0)
    home[:3] = [*map_ground.env_origins[0, 0, :2], map_ground.env_origins[0, 0, 2] + 0.35]
    poses = np.tile(home, (8, 3, 1)).astype(np.float32)
    poses[:, 1, 1] += 1
    poses[:, 2, 0] += 500  # so far away that it is not drawn
    poses[:, :, 0] += np.linspace(0, 6 / 25 * 7, 8)[:, None]
    shots = (
        Shot(robot=0, start=0, stop=6, captions=("first",) * 6),
        Shot(robot=1, start=2, stop=3, captions=("",)),
        Shot(robot=1, start=2, stop=3, captions=("second",)),
    )
    return Film(model=model, poses=poses, shots=shots, fps=25.0, size=SIZE)


@pytest.fixture(scope="module")
def drawn(film, tmp_path_factory):
    """Return the frames of its video; skips where MuJoCo cannot draw."""
    path = tmp_path_factory.mktemp("film") / "film.mp4"
    try:
        assert list(film_frames(film, path)) == list(range(8))
    except PicturesError as error:
        pytest.skip(str(error))
    assert [each.name for each in path.parent.iterdir()] == ["film.mp4"]
    return read(path)


def read(path):
    reader = cv2.VideoCapture(str(path))
    assert reader.get(cv2.CAP_PROP_FPS) == 25
    frames = []
    while True:
        more, frame = reader.read()
        if not more:
            return np.array(frames).astype(int)
        frames.append(frame)


def test_it_can_be_played_and_has_every_frame(drawn):
    assert drawn.shape == (8, SIZE[1], SIZE[0], 3)


def test_something_is_to_be_seen_and_moves(drawn):
    assert drawn[0].std() > 10
    assert np.abs(drawn[5] - drawn[0]).mean() > 1
    assert np.abs(drawn[6] - drawn[2]).mean() > 1  # another robot at the same time


def test_far_away_is_bright_and_near_is_ground(drawn):
    for frame in drawn:
        top, bottom = frame[: SIZE[1] // 12].mean(), frame[2 * SIZE[1] // 3 :].mean()
        assert top > 200
        assert bottom < top - 20


def test_captions_are_below_on_the_left(drawn):
    bare, captioned = drawn[6:]  # twice the same
    changed = np.abs(captioned - bare).max(axis=2) > 25
    rows, columns = np.nonzero(changed)
    assert len(rows) > 5
    assert rows.min() > 0.8 * SIZE[1]
    assert columns.max() < 0.5 * SIZE[0]


def test_tops_that_overlap_in_one_plane_are_no_brighter(tmp_path):
    robot = '<body pos="0 0 0.6"><freejoint/><geom size="0.1"/></body>'
    slab = '<geom type="box" size="9 9 0.5" pos="{} 0 -0.5"/>'
    frames = []
    for number, places in enumerate([[0], [0, 1, -1]]):
        ground = "".join(slab.format(x) for x in places)
        text = f"<mujoco><worldbody>{ground}{robot}</worldbody></mujoco>"
        model = mujoco.MjModel.from_xml_string(text)
        poses = np.tile(model.qpos0, (1, 1, 1)).astype(np.float32)
        shots = (Shot(robot=0, start=0, stop=1, captions=("",)),)
        film = Film(model=model, poses=poses, shots=shots, fps=25.0, size=SIZE)
        path = tmp_path / f"{number}.mp4"
        try:
            list(film_frames(film, path))
        except PicturesError as error:
            pytest.skip(str(error))
        frames.append(read(path)[0])
    one, several = frames
    brighter = (several - one)[SIZE[1] // 2 :]
    assert brighter.max() < 25


def test_an_existing_video_stays_unless_told(film, tmp_path):
    path = tmp_path / "film.mp4"
    path.write_bytes(b"mine")
    with pytest.raises(ExportError, match="exists"):
        next(film_frames(film, path))
    assert path.read_bytes() == b"mine"


@pytest.mark.parametrize("name", ["film.avi", "film", "film.mp4.png"])
def test_other_formats_are_refused(tmp_path, name):
    with pytest.raises(ConfigError, match=r"wanted a name that ends in \.mp4"):
        check_video(tmp_path / name)


@pytest.mark.parametrize("size", [(0, 96), (161, 96), (160, 5000), (-2, 96)])
def test_sizes_that_cannot_be_are_refused(film, size):
    with pytest.raises(ConfigError, match="wanted two even numbers from 64 to 4096"):
        Film(model=film.model, poses=film.poses, shots=film.shots, fps=25.0, size=size)


def test_a_film_without_frames_is_refused(film):
    with pytest.raises(ConfigError, match="no frames"):
        Film(model=film.model, poses=film.poses, shots=(), fps=25.0)


def test_a_graphics_library_that_is_not_there_is_an_error(film, tmp_path, monkeypatch):
    monkeypatch.setenv("TERRAINKIT_MUJOCO_GL", "osmesa")
    monkeypatch.setenv("PYOPENGL_PLATFORM", "osmesa")
    broken = {"PATH": "", "MUJOCO_GL": "crayons"}
    monkeypatch.setattr(gl_backend, "environment", lambda _: broken)
    path = tmp_path / "film.mp4"
    with pytest.raises(PicturesError, match=r"MuJoCo cannot draw here \(osmesa: .*MUJOCO_GL says"):
        list(film_frames(film, path))
    assert list(tmp_path.iterdir()) == []


def test_a_crash_is_an_error_and_leaves_nothing(film, tmp_path, monkeypatch):
    monkeypatch.setenv("TERRAINKIT_MUJOCO_GL", "egl")
    monkeypatch.setattr(video.sys, "executable", "/bin/false")
    with pytest.raises(PicturesError, match="egl: it crashed"):
        list(film_frames(film, tmp_path / "film.mp4"))
    assert list(tmp_path.iterdir()) == []


def test_what_never_comes_back_is_ended_with_what_it_started(film, tmp_path, monkeypatch):
    sleeper, told = tmp_path / "sleeper", tmp_path / "told"
    sleeper.write_text(f"#!/bin/sh\nsleep 60 &\necho $! > {told}\nwait\n")
    sleeper.chmod(0o755)
    monkeypatch.setattr(video.sys, "executable", str(sleeper))
    monkeypatch.setattr(video, "_PATIENCE", 0.5)
    with pytest.raises(PicturesError, match="did not draw in time"):
        list(film_frames(film, tmp_path / "film.mp4"))
    assert sorted(each.name for each in tmp_path.iterdir()) == ["sleeper", "told"]
    stat = Path(f"/proc/{int(told.read_text())}/stat")
    deadline = time.monotonic() + 5
    while stat.exists() and stat.read_text().split()[2] != "Z" and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not stat.exists() or stat.read_text().split()[2] == "Z"


def test_a_video_that_cannot_be_written_is_an_error_and_tried_once(film, tmp_path, monkeypatch):
    program = tmp_path / "python"
    program.write_text('#!/bin/sh\necho \'{"unwritten": "ffmpeg: no  space"}\' > answer.json\n')
    program.chmod(0o755)
    monkeypatch.setattr(video.sys, "executable", str(program))
    path = tmp_path / "film.mp4"
    with pytest.raises(ExportError, match=r"film\.mp4 cannot be written: ffmpeg: no space$"):
        list(film_frames(film, path))
    assert [each.name for each in tmp_path.iterdir()] == ["python"]
