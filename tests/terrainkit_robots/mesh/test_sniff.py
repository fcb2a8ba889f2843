import os
import struct
from pathlib import Path

import pytest

from terrainkit_robots.mesh.sniff import header_of, read_header


def stl(faces, data=None):
    return bytes(80) + struct.pack("<I", faces) + (bytes(50 * faces) if data is None else data)


ASCII = b"solid x\nfacet normal 0 0 1\nouter loop\nendloop\nendfacet\nendsolid x\n"
DAE = b"<?xml version='1.0'?><COLLADA></COLLADA>\n"
LFS = b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 1050284\n"


@pytest.mark.parametrize(
    ("suffix", "data", "kind", "faces"),
    [
        pytest.param(".stl", stl(2), "stl", 2, id="binary STL"),
        pytest.param(".STL", b"solid".ljust(80) + stl(1)[80:], "stl", 1, id="that says solid"),
        pytest.param(".stl", ASCII, "ascii-stl", None, id="ASCII STL"),
        pytest.param(".obj", b"# nothing\n", "obj", None, id="OBJ"),
        pytest.param(".dae", DAE, "dae", None, id="COLLADA"),
        pytest.param(".dae", DAE.decode().encode("utf-16"), "dae", None, id="in UTF-16"),
        pytest.param(".msh", struct.pack("<4i", 1, 0, 0, 0) + bytes(12), "msh", None, id="MSH"),
        pytest.param(".ply", b"ply\nelement face 7\nend_header\n", "ply", 7, id="PLY"),
        pytest.param(".glb", b"glTF" + struct.pack("<II", 2, 12), "glb", None, id="GLB"),
        pytest.param(".fbx", b"Kaydara", "other", None, id="something else"),
    ],
)
def test_valid_files(suffix, data, kind, faces):
    header = header_of(suffix, data)
    assert (header.format, header.faces, header.state) == (kind, faces, "fine")
    assert header.size == len(data)
    assert not header.problem


@pytest.mark.parametrize(
    ("suffix", "data", "problem"),
    [
        pytest.param(".stl", stl(2)[:-1], "declares 2 faces, which need 184 bytes", id="cut off"),
        pytest.param(".stl", stl(2) + b"\0", "has 185 bytes", id="too long"),
        pytest.param(".stl", stl(0), "has no faces", id="no faces"),
        pytest.param(".stl", stl(2**32 - 1, b""), "declares 4,294,967,295 faces", id="4 billion"),
        pytest.param(".stl", b"\0" * 10, "has 10 bytes; the header", id="shorter than a header"),
        pytest.param(".stl", b"v 0 0 0\n" * 20, "is a text file, but not", id="an OBJ"),
        pytest.param(".stl", b"solid x\nendsolid x\n", "without facets", id="solid air"),
        pytest.param(".stl", ASCII[:-12], "does not end with endsolid", id="ASCII, cut off"),
        pytest.param(".stl", b"solid".ljust(4097), "has no facet in its first 4096", id="blank"),
        pytest.param(".obj", stl(1), "is not a text file", id="an STL as OBJ"),
        pytest.param(".dae", DAE[:-4], "is truncated", id="COLLADA, cut off"),
        pytest.param(".dae", b"<robot/>", "does not start with a COLLADA", id="other XML"),
        pytest.param(".msh", struct.pack("<4i", 9, 0, 0, 0), "do not match its 16 bytes", id="MSH"),
        pytest.param(".msh", struct.pack("<4i", -1, 1, 0, 0), "do not match", id="negative MSH"),
        pytest.param(".msh", b"", "is empty: it has 0 bytes", id="empty"),
        pytest.param(".ply", b"plx\n", "does not start with ply", id="PLY"),
        pytest.param(".glb", b"glTF" + bytes(90), "does not match its 94 bytes", id="GLB"),
        pytest.param(".stl", b"\n <!DOCTYPE html>\n<html>", "is an HTML page", id="a web page"),
    ],
)
def test_broken_files(suffix, data, problem):
    header = header_of(suffix, data)
    assert header.state == ("broken" if data else "empty")
    assert problem in header.problem


@pytest.mark.parametrize(
    ("data", "faces"),
    [(stl(2) + b"\0", 2), (stl(2)[:-1], None), (stl(1, bytes(49)), None), (stl(0) + b"\0", None)],
)
def test_broken_stl_has_its_faces_if_more_data_follows(data, faces):
    assert (header_of(".stl", data).faces, header_of(".stl", data).state) == (faces, "broken")


@pytest.mark.parametrize("suffix", [".stl", ".dae", ".obj", ".fbx"])
def test_git_lfs_pointer(suffix):
    header = header_of(suffix, LFS)
    assert header.state == "lfs"
    assert "1,050,284 bytes" in header.problem


def test_only_ends_are_read(tmp_path):
    path = tmp_path / "a.dae"
    with path.open("wb") as stream:  # a hole of 4 GB that no disk holds
        stream.write(DAE[:-11])
        stream.seek(4 * 2**30)
        stream.write(DAE[-11:])
    header = read_header(path)
    assert (header.state, header.size) == ("fine", 4 * 2**30 + 11)


def link_to_device(path):
    path.symlink_to("/dev/zero")


@pytest.mark.parametrize(
    ("make", "state", "problem"),
    [
        pytest.param(str, "missing", "does not exist", id="missing"),
        pytest.param(Path.mkdir, "special", "is a folder, not a file", id="folder"),
        pytest.param(os.mkfifo, "special", "is a pipe, not a file", id="pipe"),
        pytest.param(link_to_device, "special", "is a device, not a file", id="device"),
        pytest.param(lambda path: path.symlink_to(path), "missing", "does not exist", id="cycle"),
    ],
)
def test_special_files(tmp_path, make, state, problem):
    make(tmp_path / "a.stl")
    header = read_header(tmp_path / "a.stl")
    assert (header.state, header.problem) == (state, problem)


@pytest.mark.parametrize("name", ["a" * 300, "a\0b", "\ud800"])
def test_invalid_path_is_missing(tmp_path, name):
    assert read_header(tmp_path / name).state == "missing"


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may read all")
def test_file_without_permission_is_closed(tmp_path):
    (tmp_path / "a.stl").write_bytes(stl(1))
    (tmp_path / "a.stl").chmod(0)
    assert read_header(tmp_path / "a.stl").state == "closed"
