import io
import json

import pytest

from terrainkit_robots.onboarding import picture_process
from terrainkit_robots.onboarding.picture_process import ANSWER, main


@pytest.fixture
def answer(tmp_path, monkeypatch):
    """Return what is answered of a robot that cannot be drawn, so that no library is asked."""

    def ask(text, qpos=None):
        (tmp_path / "robot.xml").write_text(text)
        request = {
            "folder": str(tmp_path),
            "model": str(tmp_path / "robot.xml"),
            "qpos": qpos,
            "size": [64, 48],
        }
        monkeypatch.setattr("sys.stdin", io.StringIO(json.dumps(request)))
        main()
        return json.loads((tmp_path / ANSWER).read_text())

    return ask


def world(inner):
    return f"<mujoco><worldbody>{inner}</worldbody></mujoco>"


@pytest.mark.parametrize(
    ("text", "qpos", "says"),
    [
        (world(""), None, "the robot has no shape to be seen"),
        (world('<geom type="plane" size="1 1 1"/>'), None, "the robot has no shape to be seen"),
        (world('<geom size="1"/>'), [0.0], "its pose has 1 numbers; wanted 0"),
        (world('<geom size="1" pos="1e9 0 0"/>'), None, "the robot reaches beyond 1000 m"),
        (world('<body><joint type="slide"/><geom size="1"/></body>'), [1e9], "beyond 1000 m"),
        (world('<body><joint/><geom size="1"/></body>'), [float("nan")], "beyond 1000 m"),
        ("<mujoco", None, "XML"),
        (world('<geom type="mesh" mesh="m"/>'), None, "mesh"),
    ],
)
def test_what_cannot_be_drawn_is_told(answer, text, qpos, says):
    told = answer(text, qpos)
    assert list(told) == ["undrawable"]
    assert says in told["undrawable"]


def test_whatever_a_graphics_library_raises_is_told(answer, monkeypatch):
    def fail(*_):
        raise AttributeError("no glGetError")

    monkeypatch.setattr(picture_process, "_answer", fail)
    assert answer("") == {"failed": "AttributeError: no glGetError"}
