import sys

import cv2
import numpy as np
import pytest

pytest.importorskip("imageio_ffmpeg", reason="the extra `train` is not installed")

from terrainkit_robots.rl import mp4
from terrainkit_robots.rl.mp4 import Mp4Error, Mp4Writer

SIZE = (96, 64)
RED = np.full((64, 96, 3), (200, 30, 30), np.uint8)
BLUE = np.full((64, 96, 3), (30, 30, 200), np.uint8)


def read(path):
    reader = cv2.VideoCapture(str(path))
    frames = []
    while (read := reader.read())[0]:
        frames.append(read[1][:, :, ::-1].astype(int))
    return frames, reader.get(cv2.CAP_PROP_FPS)


@pytest.fixture
def program(tmp_path, monkeypatch):
    """Let a shell script be ffmpeg."""

    def make(script):
        file = tmp_path / "ffmpeg"
        file.write_text(f"#!/bin/sh\n{script}\n")
        file.chmod(0o755)
        monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(file))

    return make


def fill(video):
    """Write more than fits a pipe."""
    for _ in range(200):
        video.write(RED)


def test_what_is_written_can_be_read(tmp_path):
    path = tmp_path / "film.mp4"
    with Mp4Writer(path, SIZE, 25.0) as video:
        for picture in (RED, RED, BLUE, BLUE[::-1]):
            video.write(picture)
    frames, fps = read(path)
    assert fps == 25
    assert len(frames) == 4
    for frame, picture in zip(frames, (RED, RED, BLUE, BLUE), strict=True):
        assert frame.shape == picture.shape
        assert np.abs(frame - picture).mean() < 6
    data = path.read_bytes()
    assert b"avc1" in data  # H.264
    assert data.index(b"moov") < data.index(b"mdat")  # plays before all of it is there


def test_what_is_there_is_replaced_and_odd_rates_are_kept(tmp_path):
    path = tmp_path / "film.mp4"
    path.write_bytes(b"old")
    with Mp4Writer(path, SIZE, 1 / 0.06) as video:
        video.write(RED)
    frames, fps = read(path)
    assert len(frames) == 1
    assert fps == pytest.approx(1 / 0.06, rel=1e-3)


def test_what_cannot_be_written_is_one_line(tmp_path):
    with (  # the writer's own end is part of what fails
        pytest.raises(Mp4Error, match=r"^ffmpeg: .*No such file") as told,
        Mp4Writer(tmp_path / "nowhere/film.mp4", SIZE, 25.0) as video,
    ):
        fill(video)
    assert "\n" not in str(told.value)


@pytest.mark.skipif(sys.platform != "linux", reason="there is no /dev/full")
def test_a_full_disk_is_one_line(tmp_path):
    path = tmp_path / "film.mp4"
    path.symlink_to("/dev/full")
    with (
        pytest.raises(Mp4Error, match="No space left on device") as told,
        Mp4Writer(path, SIZE, 25.0) as video,
    ):
        video.write(RED)
    assert "\n" not in str(told.value)


@pytest.mark.skipif(sys.platform == "win32", reason="the program is a shell script")
class TestPrograms:
    def test_one_that_ends_early_is_told_by_its_first_words(self, program, tmp_path):
        program("echo 'Unknown encoder  libx264' >&2; echo more >&2; exit 3")
        with (
            pytest.raises(Mp4Error, match=r"^ffmpeg: Unknown encoder libx264$"),
            Mp4Writer(tmp_path / "film.mp4", SIZE, 25.0) as video,
        ):
            fill(video)

    def test_one_that_says_nothing_is_told_by_its_code(self, program, tmp_path):
        program("cat > /dev/null; exit 3")
        with (
            pytest.raises(Mp4Error, match=r"^ffmpeg: it ended with code 3$"),
            Mp4Writer(tmp_path / "film.mp4", SIZE, 25.0) as video,
        ):
            video.write(RED)

    def test_one_that_does_not_listen_any_more(self, program, tmp_path, monkeypatch):
        monkeypatch.setattr(mp4, "_PATIENCE", 0.2)
        program("exec 0<&-; exec sleep 30")
        with (
            pytest.raises(Mp4Error, match="ffmpeg takes no more frames"),
            Mp4Writer(tmp_path / "film.mp4", SIZE, 25.0) as video,
        ):
            fill(video)
        assert video._process.returncode is not None

    def test_one_that_never_finishes(self, program, tmp_path, monkeypatch):
        monkeypatch.setattr(mp4, "_PATIENCE", 0.2)
        program("cat > /dev/null; exec sleep 30")
        with (
            pytest.raises(Mp4Error, match="did not finish the video in time"),
            Mp4Writer(tmp_path / "film.mp4", SIZE, 25.0) as video,
        ):
            video.write(RED)
        assert video._process.returncode is not None

    def test_an_error_between_frames_ends_it(self, program, tmp_path):
        program("cat > /dev/null; exec sleep 30")
        with (
            pytest.raises(KeyError, match="mine"),
            Mp4Writer(tmp_path / "film.mp4", SIZE, 25.0) as video,
        ):
            raise KeyError("mine")
        assert video._process.returncode is not None


def test_a_program_that_is_not_there(tmp_path, monkeypatch):
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(tmp_path / "none"))
    with pytest.raises(Mp4Error, match="ffmpeg does not run"):
        Mp4Writer(tmp_path / "film.mp4", SIZE, 25.0)


def test_a_package_that_is_not_there(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(Mp4Error, match=r"pip install 'terrainkit\[train\]'"):
        Mp4Writer(tmp_path / "film.mp4", SIZE, 25.0)
