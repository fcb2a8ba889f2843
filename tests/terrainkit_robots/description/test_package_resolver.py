import os
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terrainkit_robots.description.package_resolver import (
    PackageResolver,
    filename_on_disk,
    is_absolute,
    is_package_uri,
    resolve_in,
)


def resolve(name, file, packages):
    return PackageResolver(file, packages).resolve(name)


def find_package(name, file, packages):
    return PackageResolver(file, packages).find_package(name)


@pytest.fixture(autouse=True)
def no_ros(monkeypatch):
    monkeypatch.delenv("ROS_PACKAGE_PATH", raising=False)
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)


@pytest.fixture
def place(tmp_path):
    """Return a function that makes files in an empty folder and gives their paths."""

    def make(*names):
        for name in names:
            path = tmp_path / name
            path.parent.mkdir(parents=True, exist_ok=True)
            # a package is called like its folder, with _pkg, to tell the two apart
            path.write_text(f"<package><name>{path.parent.name}_pkg</name></package>")
        return [tmp_path / name for name in names]

    return make


def same(found, path):
    return os.path.realpath(found[0]) == os.path.realpath(path)


class TestPaths:
    def test_relative_to_the_file(self, place):
        robot, mesh = place("dog/urdf/dog.urdf", "dog/meshes/foot.stl")
        assert resolve("../meshes/foot.stl", robot, {}) == (
            robot.parent / "../meshes/foot.stl",
            "path",
        )
        assert same(resolve("../meshes/foot.stl", robot, {}), mesh)

    def test_absolute(self, place):
        robot, mesh = place("dog.urdf", "foot.stl")
        assert resolve(str(mesh), robot, {}) == (mesh, "path")
        assert resolve(f"file://{mesh}", robot, {}) == (mesh, "path")

    def test_file_uri_with_space(self, place):
        robot, mesh = place("dog.urdf", "my foot.stl")
        assert resolve(f"file://{mesh.parent}/my%20foot.stl", robot, {}) == (mesh, "path")

    @pytest.mark.parametrize("name", ["../Meshes/FOOT.STL", "..\\meshes\\foot.stl"])
    def test_ignores_case(self, place, name):
        robot, mesh = place("dog/urdf/dog.urdf", "dog/meshes/foot.stl")
        found = resolve(name, robot, {})
        assert found[1] == "search"
        assert same(found, mesh)

    def test_ambiguous_case_is_not_resolved(self, place):
        robot, *_ = place("dog.urdf", "a/foot.stl", "a/FOOT.stl")
        assert resolve("a/Foot.stl", robot, {})[1] == "nothing"

    @pytest.mark.parametrize(
        "name", ["/home/x/dog/meshes/foot.stl", "C:\\x\\dog\\meshes\\foot.stl", "meshes/foot.stl"]
    )
    def test_found_by_path_suffix(self, place, name):
        robot, mesh = place("dog/urdf/dog.urdf", "dog/meshes/foot.stl")
        found = resolve(name, robot, {})
        assert found[1] == "search"
        assert same(found, mesh)

    def test_missing_file_has_expected_path(self, place):
        (robot,) = place("dog/dog.urdf")
        assert resolve("a/foot.stl", robot, {}) == (robot.parent / "a/foot.stl", "nothing")

    def test_url_is_not_downloaded(self, place):
        robot, _ = place("dog.urdf", "foot.stl")
        assert resolve("https://example.org/foot.stl", robot, {})[1] == "nothing"

    def test_pipe_exists(self, place):
        (robot,) = place("dog.urdf")
        os.mkfifo(robot.parent / "foot.stl")
        assert resolve("foot.stl", robot, {}) == (robot.parent / "foot.stl", "path")


class TestPackageNames:
    @pytest.mark.parametrize(
        "name", ["package://dog/m/foot.stl", "model://dog/m/foot.stl", "$(find dog)/m/foot.stl"]
    )
    def test_given(self, place, name):
        robot, mesh = place("a/dog.urdf", "b/c/m/foot.stl")
        found = resolve(name, robot, {"dog": mesh.parents[1]})
        assert found == (mesh, "package")

    def test_given_package_has_precedence(self, place):
        robot, _, mesh = place("dog/dog.urdf", "dog/foot.stl", "b/foot.stl")
        assert resolve("package://dog/foot.stl", robot, {"dog": mesh.parent}) == (mesh, "package")
        assert resolve("package://dog/foot.stl", robot, {"dog": Path("nowhere")}) == (
            robot.parent / "foot.stl",
            "search",
        )

    def test_package_xml_in_parent_folder(self, place):
        robot, _, mesh = place("dog/urdf/dog.urdf", "dog/package.xml", "dog/m/foot.stl")
        found = resolve("package://dog_pkg/m/foot.stl", robot, {})
        assert found[1] == "package"
        assert same(found, mesh)

    def test_name_of_parent_folder(self, place):
        robot, mesh = place("dog/urdf/dog.urdf", "dog/m/foot.stl")
        found = resolve("package://dog/m/foot.stl", robot, {})
        assert found[1] == "search"
        assert same(found, mesh)

    def test_sibling_folder(self, place):
        robot, mesh = place("ws/a/urdf/dog.urdf", "ws/dog_meshes/m/foot.stl")
        found = resolve("package://dog_meshes/m/foot.stl", robot, {})
        assert same(found, mesh)

    def test_sibling_package(self, place):
        robot, _, mesh = place("ws/a/urdf/dog.urdf", "ws/b/package.xml", "ws/b/m/foot.stl")
        found = resolve("package://b_pkg/m/foot.stl", robot, {})
        assert found[1] == "package"
        assert same(found, mesh)

    def test_package_with_file_is_preferred(self, place):
        robot, mesh = place("dog/dog/dog.urdf", "dog/m/foot.stl")
        assert same(resolve("package://dog/m/foot.stl", robot, {}), mesh)

    def test_renamed_package_folder(self, place):
        robot, mesh = place("dog-main/urdf/dog.urdf", "dog-main/m/foot.stl")
        found = resolve("package://dog_description/m/foot.stl", robot, {})
        assert found[1] == "search"
        assert same(found, mesh)

    @pytest.mark.parametrize(
        ("variable", "folder"), [("ROS_PACKAGE_PATH", "src"), ("AMENT_PREFIX_PATH", "src/share")]
    )
    def test_ros_environment_variables(self, place, monkeypatch, tmp_path, variable, folder):
        robot, mesh = place("far/from/all/of/it/dog.urdf", f"{folder}/dog/m/foot.stl")
        monkeypatch.setenv(variable, f"/nowhere{os.pathsep}{tmp_path / 'src'}")
        assert resolve("package://dog/m/foot.stl", robot, {}) == (mesh, "package")

    def test_ignores_case(self, place):
        robot, mesh = place("dog/urdf/dog.urdf", "dog/m/foot.stl")
        assert same(resolve("package://dog/M/Foot.STL", robot, {}), mesh)

    def test_package_without_file(self, place):
        robot, _ = place("dog/urdf/dog.urdf", "dog/package.xml")
        found = resolve("package://dog_pkg/m/foot.stl", robot, {})
        assert found[1] == "package"
        assert not found[0].exists()

    def test_file_name_instead_of_package(self, place):
        robot, mesh = place("dog.urdf", "wheel.obj")
        assert resolve("package://wheel.obj", robot, {}) == (mesh, "search")

    def test_find_package(self, place):
        robot, package = place("dog/urdf/dog.urdf", "dog/package.xml")
        found = find_package("dog_pkg", robot, {})
        assert found is not None
        assert found.samefile(package.parent)
        assert find_package("cat", robot, {}) is None
        assert find_package("cat", robot, {"cat": Path("x")}) == Path("x")


class TestUntrustedNames:
    NAMES = (
        "",
        "\0",
        "a\0b",
        "package://",
        "package://..",
        "package://../../etc/passwd",
        "package://\0/x",
        "x" * 5000,
        "../" * 1300 + "x",
        "../" * 1_000_000 + "x",
        "a/" * 2000 + "x",
        "package://a/" + "b/" * 2000,
        "\\" * 4000 + "x",
        "\ud800",
        "~/x",
        "//x/y",
        "file://",
        "C:",
        "$(find )",
        "$(find a",
        ".",
        "..",
        "loop/x",
    )

    @pytest.mark.parametrize("name", NAMES, ids=range(len(NAMES)))
    def test_hostile_names(self, place, name):
        (robot,) = place("a/dog.urdf")
        (robot.parent / "loop").symlink_to("loop")
        path, _ = resolve(name, robot, {})
        assert "\0" not in str(path)
        assert filename_on_disk(name, path) is None

    @settings(max_examples=40, deadline=None)
    @given(st.text(max_size=40))
    def test_any_text(self, text):
        for name in (text, f"package://{text}", f"$(find {text})/x", f"C:\\{text}"):
            path, found_by = resolve(name, Path("/nowhere/dog.urdf"), {})
            assert found_by in ("path", "package", "search", "nothing")
            filename_on_disk(name, path)

    def test_symbolic_link_cycle(self, place):
        (robot,) = place("a/dog.urdf")
        (robot.parent / "loop").symlink_to("loop")
        assert resolve("package://cat/x", robot.parent / "loop/dog.urdf", {})[1] == "nothing"

    def test_package_xml_is_pipe_or_binary(self, place):
        robot, package = place("a/dog.urdf", "b/package.xml")
        os.mkfifo(robot.parent / "package.xml")
        package.write_bytes(bytes(range(256)) * 1000)
        assert find_package("nothing", robot, {}) is None


class TestPackages:
    def test_package_search_is_cached(self, place, monkeypatch):
        robot, _ = place("dog/urdf/dog.urdf", "dog/m/foot.stl")
        packages = PackageResolver(robot, {})
        first = packages.resolve("package://dog/m/foot.stl")
        monkeypatch.setattr(os, "scandir", None)  # what is not asked cannot fail
        assert packages.resolve("package://dog/m/foot.stl") == first


def test_resolve_in_folders(place):
    first, second = place("a/foot.stl", "b/hand.stl")
    folders = (first.parent, second.parent)
    assert resolve_in(folders, "foot.stl") == (first, "path")
    assert resolve_in(folders, "hand.stl") == (second, "path")
    assert resolve_in(folders, "HAND.stl") == (second, "search")
    assert resolve_in(folders, "head.stl") == (first.parent / "head.stl", "nothing")
    assert resolve_in(folders, str(second)) == (second, "path")
    assert resolve_in(folders, "a\0b")[1] == "nothing"


@pytest.mark.parametrize(
    ("name", "right"),
    [
        ("meshes/foot.stl", None),
        ("./meshes//foot.stl", None),
        ("meshes/Foot.STL", "meshes/foot.stl"),
        ("../x/Meshes/foot.stl", "../x/meshes/foot.stl"),
        ("meshes\\foot.stl", "meshes/foot.stl"),
        ("package://dog/Meshes\\foot.stl", "package://dog/meshes/foot.stl"),
        ("$(find dog)/meshes/FOOT.stl", "$(find dog)/meshes/foot.stl"),
        ("file://Meshes/foot.stl", "file://meshes/foot.stl"),
        ("stl/foot.stl", None),
        ("/x/Meshes/foot.stl", None),
        ("C:\\x\\Meshes\\foot.stl", None),
    ],
)
def test_filename_on_disk(place, name, right):
    (mesh,) = place("x/meshes/foot.stl")
    assert filename_on_disk(name, mesh) == right


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
