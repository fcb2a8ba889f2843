import pytest

from terrainkit_robots.gl_backend import backends, child_environment, installation_advice


@pytest.fixture(autouse=True)
def no_backend(monkeypatch):
    for name in ("MUJOCO_GL", "TERRAINKIT_MUJOCO_GL", "PYOPENGL_PLATFORM"):
        monkeypatch.delenv(name, raising=False)


@pytest.mark.parametrize(
    ("system", "expected"), [("linux", ("egl", "osmesa")), ("darwin", ("",)), ("win32", ("",))]
)
def test_backends_depend_on_system(monkeypatch, system, expected):
    monkeypatch.setattr("sys.platform", system)
    assert backends() == expected


@pytest.mark.parametrize("name", ["MUJOCO_GL", "TERRAINKIT_MUJOCO_GL"])
def test_backends_requested_is_only_one(monkeypatch, name):
    monkeypatch.setenv(name, " osmesa")
    assert backends() == ("osmesa",)
    assert "unset it" in installation_advice()


def test_backends_prefer_value_saved_by_cli(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "disable")
    monkeypatch.setenv("TERRAINKIT_MUJOCO_GL", "glfw")
    assert backends() == ("glfw",)


def test_advice_without_request_names_packages():
    assert installation_advice().startswith("install EGL or OSMesa")


def test_child_environment_has_a_backend_and_no_shader_cache(monkeypatch):
    monkeypatch.setenv("PYOPENGL_PLATFORM", "glx")
    monkeypatch.setenv("MUJOCO_GL", "glfw")
    monkeypatch.delenv("MESA_SHADER_CACHE_DISABLE", raising=False)
    monkeypatch.setenv("__GL_SHADER_DISK_CACHE", "1")
    variables = child_environment("egl")
    assert "PYOPENGL_PLATFORM" not in variables
    assert variables["MUJOCO_GL"] == "egl"
    assert "MUJOCO_GL" not in child_environment("")
    assert variables["MESA_SHADER_CACHE_DISABLE"] == "true"
    assert variables["__GL_SHADER_DISK_CACHE"] == "1"
