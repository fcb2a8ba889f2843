import re
import subprocess

import cv2
import numpy as np
import pytest

from terrainkit_robots import gl_backend
from terrainkit_robots.description import bundled
from terrainkit_robots.onboarding import pictures
from terrainkit_robots.onboarding.pictures import PicturesError, draw

SIZE = (144, 120)
QUADRUPED = bundled.find("quadruped").with_suffix(".xml")


@pytest.fixture(scope="module")
def red(tmp_path_factory):
    """Return pictures of the bundled quadruped, painted red; skips where MuJoCo cannot draw."""
    text = QUADRUPED.read_text()
    file = tmp_path_factory.mktemp("robot") / "robot.xml"
    file.write_text(re.sub(r'(<material [^>]*rgba=)"[^"]*"', r'\1"1 0 0 1"', text))
    try:
        drawn = draw(file, size=SIZE)
    except PicturesError as error:
        pytest.skip(str(error))
    assert [each.name for each in file.parent.iterdir()] == ["robot.xml"]  # and no log
    return {
        name: cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR).astype(int)
        for name, data in drawn.items()
    }


def test_the_robot_is_seen_whole_from_three_sides(red):
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
        assert filled == pytest.approx(0.86, abs=0.06)


def test_the_ground_is_light_with_a_shadow_on_it(red):
    for picture in red.values():
        ground = picture[(abs(picture[:, :, 2] - picture[:, :, 1]) < 20)]
        assert np.median(ground) > 220
        assert 0.01 < (ground.mean(axis=1) < 170).mean() < 0.4


def test_the_sides_differ(red):
    front, side, corner = red.values()
    assert np.abs(front - side).mean() > 5
    assert np.abs(corner - side).mean() > 5


def test_a_library_that_is_asked_for_and_not_there_is_told(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "nonsense")
    with pytest.raises(PicturesError, match=r"cannot draw here \(nonsense: .*MUJOCO_GL") as told:
        draw(QUADRUPED, size=SIZE)
    assert "\n" not in str(told.value)


def test_the_next_library_is_tried_and_then_all_are_told(monkeypatch, tmp_path):
    asked = []

    def ask(_request, library, _deadline, folder):
        asked.append(library)
        if library == "egl":
            return {"failed": "no"}
        (folder / "front.png").write_bytes(b"png")
        return {"pictures": ["front"]}

    monkeypatch.setattr(pictures, "_ask", ask)
    monkeypatch.setattr(gl_backend, "libraries", lambda: ("egl", "osmesa"))
    assert draw(tmp_path) == {"front": b"png"}
    assert asked == ["egl", "osmesa"]
    monkeypatch.setattr(pictures, "_ask", lambda *_: {"failed": "no"})
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    with pytest.raises(PicturesError, match=r"\(egl: no; osmesa: no\); install EGL or OSMesa"):
        draw(tmp_path)


def test_a_robot_that_cannot_be_drawn_is_told_and_nothing_else_is_tried(monkeypatch, tmp_path):
    monkeypatch.setattr(gl_backend, "libraries", lambda: ("egl", "osmesa"))
    monkeypatch.setattr(pictures, "_ask", lambda *_: {"undrawable": "no shape"})
    with pytest.raises(PicturesError, match=r"^MuJoCo cannot draw it: no shape$"):
        draw(tmp_path)


def test_a_crash_costs_only_the_pictures(monkeypatch, tmp_path):
    monkeypatch.setenv("MUJOCO_GL", "egl")
    crashed = subprocess.CompletedProcess([], -11)
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: crashed)
    with pytest.raises(PicturesError, match=r"it crashed \(exit code -11\)"):
        draw(tmp_path)


def test_no_time_no_pictures():
    with pytest.raises(PicturesError, match="in time"):
        draw(QUADRUPED, seconds=0)
