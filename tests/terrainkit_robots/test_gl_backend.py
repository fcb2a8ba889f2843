from pathlib import Path

import pytest

from terrainkit_robots.gl_backend import advice, environment, libraries, take_answer


@pytest.fixture(autouse=True)
def unset(monkeypatch):
    for name in ("MUJOCO_GL", "TERRAINKIT_MUJOCO_GL", "PYOPENGL_PLATFORM"):
        monkeypatch.delenv(name, raising=False)


@pytest.mark.parametrize(
    ("system", "tried"), [("linux", ("egl", "osmesa")), ("darwin", ("",)), ("win32", ("",))]
)
def test_what_is_tried_is_known_of_each_system(monkeypatch, system, tried):
    monkeypatch.setattr("sys.platform", system)
    assert libraries() == tried


@pytest.mark.parametrize("name", ["MUJOCO_GL", "TERRAINKIT_MUJOCO_GL"])
def test_what_the_user_asks_for_is_all_that_is_tried(monkeypatch, name):
    monkeypatch.setenv(name, " osmesa")
    assert libraries() == ("osmesa",)
    assert advice().startswith("MUJOCO_GL says so; unset it")


def test_what_the_command_line_has_put_aside_goes_first(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "disable")
    monkeypatch.setenv("TERRAINKIT_MUJOCO_GL", "glfw")
    assert libraries() == ("glfw",)


def test_who_asked_for_nothing_is_told_what_to_install():
    assert advice().startswith("install EGL or OSMesa")


def test_the_other_process_finds_modules_here_and_takes_no_library_from_here(monkeypatch):
    monkeypatch.setenv("PYOPENGL_PLATFORM", "glx")
    monkeypatch.setenv("MUJOCO_GL", "glfw")
    monkeypatch.setattr("sys.path", ["", "somewhere"])
    variables = environment("egl")
    assert "PYOPENGL_PLATFORM" not in variables
    assert variables["MUJOCO_GL"] == "egl"
    assert "MUJOCO_GL" not in environment("")
    assert variables["PYTHONPATH"] == str(Path("somewhere").absolute())


def test_it_leaves_nothing_on_the_disk_unless_told(monkeypatch):
    monkeypatch.delenv("MESA_SHADER_CACHE_DISABLE", raising=False)
    monkeypatch.setenv("__GL_SHADER_DISK_CACHE", "1")
    variables = environment("egl")
    assert variables["MESA_SHADER_CACHE_DISABLE"] == "true"
    assert variables["__GL_SHADER_DISK_CACHE"] == "1"


def test_an_answer_is_taken_away_and_its_complaints_are_one_short_line(tmp_path):
    file = tmp_path / "answer.json"
    assert take_answer(file, "it crashed") == {"failed": "it crashed"}
    file.write_text('{"frames": 3, "failed": "no\\n display ' + 300 * "x" + '"}')
    answer = take_answer(file, "it crashed")
    assert answer["frames"] == 3
    assert answer["failed"].startswith("no display xxx")
    assert len(answer["failed"]) <= 160
    assert not file.exists()
