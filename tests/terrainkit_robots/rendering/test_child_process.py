import os
import time
from functools import partial
from itertools import repeat

import numpy as np
import psutil
import pytest

from terrainkit.files.child_process import ProcessLimits
from terrainkit_robots import gl_backend
from terrainkit_robots.rendering import child_process
from terrainkit_robots.rendering.child_process import RenderError, stream_frames

# Pickled by reference: the child process imports numpy and calls these.
TWO_FRAMES = partial(np.zeros, (2, 4, 6, 3), np.uint8)
FILLED = partial(map, partial(np.full, (4, 6, 3), dtype=np.uint8))  # a frame for each input


@pytest.fixture(autouse=True)
def backends(monkeypatch):
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.delenv("TERRAINKIT_MUJOCO_GL", raising=False)
    monkeypatch.setattr(gl_backend, "backends", lambda: ("egl", "osmesa"))


def test_stream_frames_ignores_prints_of_libraries():
    # print() returns None, which is not an iterator of frames: the error arrives unharmed.
    with pytest.raises(RenderError, match=r"egl: 'NoneType' object is not iterable; osmesa: "):
        list(stream_frames(partial(print, "x" * 100_000)))


def test_stream_frames_reports_every_backend():
    with pytest.raises(RenderError, match=r"\(egl: invalid literal .*; osmesa: .*\); install EGL"):
        list(stream_frames(partial(int, "one")))
    with pytest.raises(RenderError) as caught:
        list(stream_frames(partial(int, "\n long " * 1000)))
    assert len(str(caught.value)) < 600


def test_stream_frames_reports_invalid_backend(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "nonsense")
    monkeypatch.setattr(gl_backend, "backends", lambda: ("nonsense",))
    with pytest.raises(RenderError, match=r"cannot render here \(nonsense: .*unset it") as caught:
        list(stream_frames(TWO_FRAMES))
    assert "\n" not in str(caught.value)


def test_stream_frames_reports_crash():
    with pytest.raises(RenderError, match="egl: the process crashed, exit code 3"):
        list(stream_frames(partial(os._exit, 3)))


def test_stream_frames_stops_slow_child(monkeypatch):
    monkeypatch.setattr(child_process, "LIMITS", ProcessLimits(seconds=1.5, memory=None))
    with pytest.raises(RenderError, match=r"egl: takes more than 1\.5 s; osmesa: "):
        list(stream_frames(partial(time.sleep, 60)))


def test_stream_frames_closed_early_ends_child():
    others = set(psutil.Process().children())  # of earlier tests, such as a resource tracker
    assert [frame.shape for frame in stream_frames(TWO_FRAMES)] == 2 * [(4, 6, 3)]
    frames = stream_frames(TWO_FRAMES)
    next(frames)
    assert len(set(psutil.Process().children()) - others) == 1
    frames.close()
    assert set(psutil.Process().children()) <= others


def test_stream_frames_sends_input_of_each_frame():
    values, shown = np.zeros(3, np.uint8), []
    frames = stream_frames(FILLED, repeat(values))
    for value in (1, 2, 3):
        values[:] = value
        shown.append(next(frames).max())
    frames.close()
    assert shown == [1, 2, 3]


def test_stream_frames_waits_for_inputs_without_limit(monkeypatch):
    monkeypatch.setattr(child_process, "LIMITS", ProcessLimits(seconds=2.0, memory=None))
    frames = stream_frames(FILLED, repeat(7))
    next(frames)
    time.sleep(2.5)
    assert next(frames).max() == 7
    frames.close()
