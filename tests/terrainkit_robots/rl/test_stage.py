import json
import subprocess
import sys

import numpy as np

from terrainkit_robots import gl_backend
from terrainkit_robots.rl import stage
from terrainkit_robots.rl.mp4 import Mp4Error


def test_the_other_process_answers_what_is_wrong(tmp_path, monkeypatch):
    request = {"folder": str(tmp_path), "shots": [], "fps": 25, "size": [64, 64]}
    monkeypatch.setattr(stage.json, "load", lambda _: request)
    stage.main()
    answer = json.loads((tmp_path / "answer.json").read_text())
    assert "FileNotFoundError" in answer["failed"]


def test_the_other_process_tells_a_failing_ffmpeg_apart(tmp_path, monkeypatch):
    def draw(*_):
        raise Mp4Error("ffmpeg: no")

    monkeypatch.setattr(stage, "_draw", draw)
    monkeypatch.setattr(stage.json, "load", lambda _: {"folder": str(tmp_path)})
    stage.main()
    assert json.loads((tmp_path / "answer.json").read_text()) == {"unwritten": "ffmpeg: no"}


def test_the_camera_keeps_calm():
    path = np.zeros((100, 3), np.float32)
    path[:, 0] = np.linspace(0, 6, 100)
    path[:, 2] = 0.3 + 0.05 * (-1.0) ** np.arange(100)
    smooth = stage._smooth(path, 8.0)
    assert smooth.shape == path.shape
    np.testing.assert_allclose(smooth[:, 0], path[:, 0], atol=1e-4)  # a straight way stays
    assert np.ptp(smooth[25:-25, 2]) < 1e-3
    assert stage._smooth(path[:1], 8.0).shape == (1, 3)


def test_the_module_is_a_process_of_its_own(tmp_path):
    done = subprocess.run(
        [sys.executable, "-P", "-m", stage.__name__],
        input=b"{",
        capture_output=True,
        cwd=tmp_path,
        env=gl_backend.environment(""),
        timeout=60,
        check=False,
    )
    assert done.returncode != 0
    assert list(tmp_path.iterdir()) == []
