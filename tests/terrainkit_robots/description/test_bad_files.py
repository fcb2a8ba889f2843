"""No file crashes the linter. `make fuzz` limits its time and memory as well."""

import struct

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.check import lint_selected
from terrainkit_robots.lint.settings import Settings
from tests.robots import QUADRUPED
from tests.small_robots import box, joint, link, shape

NASTY = [
    "nan", "inf", "-inf", "1e308", "1e-320", "0", "-1", "1e29", "", " ", "x", "1 2", "1,5",
    "0 0 0", "1e29 1e29 1e29", "base", "FL_calf", "world", "${x}", "\u0661", "../..", "package://",
    "file:///dev/zero", "\x1b[31m", "a" * 5000, "revolute", "floating", "mesh", "true",
]  # fmt: skip


def check(path):
    """Return the codes of all findings; fails if a rule failed."""
    report = lint_selected(Facts(load_robot(path)), Settings(simulate=False))
    assert not report.crashed
    return {finding.code for finding in report.findings}


fuzz = settings(
    max_examples=40,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)


@pytest.mark.parametrize("suffix", [".urdf", ".xml"])
@fuzz
@given(data=st.data())
def test_damaged_robots(suffix, tmp_path, data):
    """Values, lines and bytes are replaced, removed, doubled and moved."""
    text = QUADRUPED.with_suffix(suffix).read_text()
    for _ in range(data.draw(st.integers(0, 3))):
        start = data.draw(
            st.sampled_from([k for k in range(len(text)) if text.startswith('="', k)])
        )
        end = text.find('"', start + 2)
        text = text[: start + 2] + data.draw(st.sampled_from(NASTY)) + text[end:]
    lines = text.splitlines(keepends=True)
    for _ in range(data.draw(st.integers(0, 3))):
        start, to = (data.draw(st.integers(0, len(lines))) for _ in range(2))
        end = data.draw(st.integers(start, start + 40))
        moved = lines[start:end]
        if data.draw(st.booleans()):
            del lines[start:end]
        if data.draw(st.booleans()):
            lines[to:to] = moved
    raw = bytearray("".join(lines).encode())
    for _ in range(data.draw(st.sampled_from([0, 0, 0, 1, 9]))):
        place = data.draw(st.integers(0, len(raw)))
        raw[place : place + data.draw(st.integers(0, 3))] = data.draw(st.binary(max_size=4))
    (tmp_path / f"r{suffix}").write_bytes(bytes(raw))
    check(tmp_path / f"r{suffix}")


@fuzz
@given(raw=st.binary(max_size=200))
def test_random_bytes(tmp_path, raw):
    (tmp_path / "r.urdf").write_bytes(raw)
    assert check(tmp_path / "r.urdf") & {"XML001", "XML002", "XML009"}


def robot(*parts):
    return f'<robot name="r">{"".join(parts)}</robot>'


def mesh(file):
    mesh = f'mesh filename="{file}"'
    return robot(link("a", shape(mesh), shape(mesh, kind="visual"), mass=None))


def solid(name, x):
    """Return a link with a number in all places."""
    three = f"{x} {x} {x}"
    place = {"center": three, "rpy": three}
    return link(name, box(three), mass=x, inertia=f"{three} {three}", **place)


STAR = [solid(f"l{k}", 1) for k in range(2000)]
STAR += [joint("l0", f"l{k}", limits=(-1, 1)) for k in range(1, 2000)]
BAD = {
    "loop": (robot(link("a"), link("b"), joint("a", "b"), joint("b", "a")), "TRE004"),
    "large numbers": (robot(solid("a", "1e29")), ""),
    "star": (robot(*STAR), "INR003"),
    "attributes": ("<robot " + " ".join(f"a{k}='1'" for k in range(100_000)) + "/>", "XML001"),
    "name": (robot(link("a" * 1_000_000)), ""),
    "billions of faces": (mesh("billions.stl"), "MSH006"),
    "endless mesh": (mesh("/dev/zero"), ""),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_file_is_a_finding(name, tmp_path):
    text, expected = BAD[name]
    (tmp_path / "robot.urdf").write_text(text)
    (tmp_path / "billions.stl").write_bytes(
        bytes(80) + struct.pack("<I", 4_000_000_000) + bytes(500)
    )
    assert {expected} - {""} <= check(tmp_path / "robot.urdf")
