import os
from pathlib import Path

import pytest

from terrainkit_robots.description.package_resolver import (
    PackageResolver,
    filename_on_disk,
    is_absolute,
    is_package_uri,
    resolve_in,
)
from tests.tables import read_table


def resolve(name, file, packages=None):
    return PackageResolver(file, packages or {}).resolve(name)


@pytest.fixture(autouse=True)
def no_ros(monkeypatch):
    monkeypatch.delenv("ROS_PACKAGE_PATH", raising=False)
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)


@pytest.fixture
def root(tmp_path):
    """Return a folder from which no search reaches the folders of other tests."""
    return tmp_path / "1/2/3"


@pytest.fixture
def place(root):
    """Return a function that makes files in an empty folder and gives their paths."""

    def make(*names):
        for name in names:
            path = root / name
            path.parent.mkdir(parents=True, exist_ok=True)
            # a package is called like its folder, with _pkg, to tell the two apart
            path.write_text(f"<package><name>{path.parent.name}_pkg</name></package>")
        return [root / name for name in names]

    return make


DOG = "dog/urdf/dog.urdf"


@pytest.mark.parametrize(("robot", "others", "name", "how"), read_table(__file__, "file_is_found"))
def test_file_is_found(robot, others, name, how, place):
    file, *_, mesh = place(robot, *others)
    path, found_by = resolve(name, file)
    assert (os.path.realpath(path), found_by) == (os.path.realpath(mesh), how)


def test_absolute_names(place):
    robot, mesh = place("dog.urdf", "my foot.stl")
    for name in (mesh, f"file://{mesh}", f"file:{mesh}", f"FILE://{mesh.parent}/my%20foot.stl"):
        assert resolve(str(name), robot) == (mesh, "path")


@pytest.mark.parametrize(("name", "path"), read_table(__file__, "missing_file_has_expected_path"))
def test_missing_file_has_expected_path(name, path, place):
    robot, *_ = place("dog.urdf", "foot.stl", "a/foot.stl", "a/FOOT.stl")
    assert resolve(name, robot) == (robot.parent / path, "nothing")


def test_pipe_exists(place):
    (robot,) = place("dog.urdf")
    os.mkfifo(robot.parent / "foot.stl")
    assert resolve("foot.stl", robot) == (robot.parent / "foot.stl", "path")


@pytest.mark.parametrize(
    "name", ["package://dog/m/foot.stl", "model://dog/m/foot.stl", "$(find dog)/m/foot.stl"]
)
def test_given_package_has_precedence(name, place):
    robot, near, mesh = place("dog/dog.urdf", "dog/m/foot.stl", "b/c/m/foot.stl")
    assert resolve(name, robot, {"dog": mesh.parents[1]}) == (mesh, "package")
    assert resolve(name, robot, {"dog": Path("nowhere")}) == (near, "search")
    assert resolve(name, robot, {"dog": Path("nowhere"), "cat": mesh.parents[1]})[0] == near


@pytest.mark.parametrize(
    ("variable", "folder"),
    [
        ("ROS_PACKAGE_PATH", "src/dog"),
        ("ROS_PACKAGE_PATH", "src/stack/dog"),
        ("AMENT_PREFIX_PATH", "src/share/dog"),
    ],
)
def test_ros_environment_variables(variable, folder, place, monkeypatch, root):
    robot, mesh = place("far/from/all/of/it/dog.urdf", f"{folder}/m/foot.stl")
    monkeypatch.setenv(variable, f"/nowhere{os.pathsep}{root / 'src'}")
    assert resolve("package://dog/m/foot.stl", robot) == (mesh, "package")
    if folder == "src/dog":
        monkeypatch.setenv(variable, str(root / folder))
        assert resolve("package://dog/m/foot.stl", robot) == (mesh, "package")


def test_package_without_the_file(place):
    robot, package = place(DOG, "dog/package.xml")
    expected = package.parent / "m/foot.stl"
    assert resolve("package://dog_pkg/m/foot.stl", robot) == (expected, "package")


def test_find_package(place):
    robot, package = place(DOG, "dog/package.xml")
    packages = PackageResolver(robot, {"cat": Path("x")})
    found = [packages.find_package(name) for name in ("dog_pkg", "cat", "cow")]
    assert found == [package.parent, Path("x"), None]


@pytest.mark.parametrize(("depth", "how"), [(3, "search"), (4, "nothing")])
def test_search_is_bounded(depth, how, place):
    robot, _ = place(f"ws/{'a/' * depth}dog.urdf", "ws/dog_meshes/m/foot.stl")
    assert resolve("package://dog_meshes/m/foot.stl", robot)[1] == how
    assert resolve("dog_meshes/m/foot.stl", robot)[1] == how


def test_package_search_is_cached(place, monkeypatch):
    robot, _ = place(DOG, "dog/m/foot.stl")
    packages = PackageResolver(robot, {})
    first = packages.resolve("package://dog/m/foot.stl")
    monkeypatch.setattr(os, "scandir", None)  # what is not asked cannot fail
    assert packages.resolve("package://dog/m/foot.stl") == first


# Names and files of strangers

NAMES = ["", "\0", "a\0b", ".", "..", "~/x", "//x/y", "file://", "C:", "\ud800", "loop/x"]
NAMES += ["package://", "package://..", "package://../../etc/passwd", "package://\0/x"]
NAMES += ["$(find )", "$(find a", "x" * 5000, "../" * 1300 + "x", "../" * 1_000_000 + "x"]
NAMES += ["a/" * 2000 + "x", "package://a/" + "b/" * 2000, "\\" * 4000 + "x"]


@pytest.mark.parametrize("name", NAMES, ids=range(len(NAMES)))
def test_hostile_names(place, name):
    (robot,) = place("a/dog.urdf")
    (robot.parent / "loop").symlink_to("loop")
    path, _ = resolve(name, robot)
    assert "\0" not in str(path)
    assert filename_on_disk(name, path) is None
    assert resolve("package://cat/x", robot.parent / "loop/dog.urdf")[1] == "nothing"


def test_package_xml_is_pipe_or_binary(place):
    robot, package = place("a/dog.urdf", "b/package.xml")
    os.mkfifo(robot.parent / "package.xml")
    package.write_bytes(bytes(range(256)) * 1000)
    assert PackageResolver(robot, {}).find_package("nothing") is None


def test_resolve_in_folder(place):
    first, second = place("a/foot.stl", "b/hand.stl")
    names = ["foot.stl", "FOOT.stl", "hand.stl", str(second), "a\0b"]
    assert [resolve_in(first.parent, name) for name in names] == [
        (first, "path"),
        (first, "search"),
        (first.parent / "hand.stl", "nothing"),
        (second, "path"),
        (first.parent / "ab", "nothing"),
    ]


@pytest.mark.parametrize(("name", "right"), read_table(__file__, "filename_on_disk"))
def test_filename_on_disk(place, name, right):
    (mesh,) = place("x/meshes/foot.stl")
    assert filename_on_disk(name, mesh) == (right or None)


def test_filename_on_disk_case_insensitive(place, monkeypatch):
    # On a Mac a file is found under any letters, so that only its folder knows its name.
    (mesh,) = place("x/meshes/foot.stl")
    asked = mesh.parents[1] / "Meshes/FOOT.stl"
    listed = {str(mesh.parents[1]): ["meshes"], str(asked.parent): ["foot.stl"]}
    monkeypatch.setattr(
        "terrainkit_robots.description.package_resolver._list_names",
        lambda folder: listed.get(str(folder), []),
    )
    assert filename_on_disk("Meshes/FOOT.stl", asked) == "meshes/foot.stl"


def test_is_absolute_and_is_package_uri():
    assert all(map(is_absolute, ["/a", "file:///a", "C:\\a", "c:/a", "~/a", "\\\\server\\a"]))
    assert not any(map(is_absolute, ["a", "./a", "../a", "package://a/b", "file://a", ""]))
    assert all(map(is_package_uri, ["package://a/b", "model://a/b", "$(find a)/b", "package:/a/b"]))
    assert not any(map(is_package_uri, ["a", "/a", "file://a", "https://a/b", "$(arg a)/b"]))
