"""No file crashes the linter, hangs it or fills the memory."""

import os
import struct
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.runner import INTERNAL_ERROR
from terrainkit_robots.lint.selection import lint_selected
from terrainkit_robots.lint.settings import Settings

URDF = (bundled.urdf_path("quadruped") or Path()).read_text()
MJCF = (bundled.urdf_path("quadruped") or Path()).with_suffix(".xml").read_text()

SECONDS, BYTES = 10, 2 * 2**30
"""CPU time and memory that checking any file may take."""

NASTY = [
    "nan", "inf", "-inf", "1e308", "-1e308", "1e-320", "0", "-1", "1e29", "", " ", "x", "1 2",
    "1,5", "0 0 0", "1e29 1e29 1e29", "nan nan nan", "base", "FL_calf", "world", "${x}", "\u0661",
    "../..", "package://", "file:///dev/zero", "\x1b[31m", "a" * 5000, "revolute", "floating",
    "mesh", "true",
]  # fmt: skip


def check(path: Path) -> set[str]:
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


@pytest.mark.parametrize(("text", "name"), [(URDF, "r.urdf"), (MJCF, "r.xml")])
@fuzz
@given(data=st.data())
def test_extreme_values(text, name, tmp_path, data):
    values = [i for i in range(len(text)) if text.startswith('="', i)]
    for _ in range(data.draw(st.integers(1, 4))):
        start = data.draw(st.sampled_from(values)) + 2
        end = text.find('"', start)
        text = text[:start] + data.draw(st.sampled_from(NASTY)) + text[max(end, start) :]
    (tmp_path / name).write_text(text)
    check(tmp_path / name)


@pytest.mark.parametrize(("text", "name"), [(URDF, "r.urdf"), (MJCF, "r.xml")])
@fuzz
@given(data=st.data())
def test_missing_duplicate_and_swapped_elements(text, name, tmp_path, data):
    lines = text.splitlines(keepends=True)
    for _ in range(data.draw(st.integers(1, 4))):
        a = data.draw(st.integers(0, len(lines) - 1))
        b = data.draw(st.integers(a, min(len(lines), a + 40)))
        c = data.draw(st.integers(0, len(lines) - 1))
        moved = lines[a:b]
        match data.draw(st.sampled_from(["lose", "double", "move"])):
            case "lose":
                del lines[a:b]
            case "double":
                lines[c:c] = moved
            case _:
                del lines[a:b]
                lines[c:c] = moved
        if not lines:
            break
    (tmp_path / name).write_text("".join(lines))
    check(tmp_path / name)


@pytest.mark.parametrize(("text", "name"), [(URDF, "r.urdf"), (MJCF, "r.xml")])
@fuzz
@given(data=st.data())
def test_corrupt_bytes(text, name, tmp_path, data):
    raw = bytearray(text.encode())
    for _ in range(data.draw(st.integers(1, 10))):
        place = data.draw(st.integers(0, len(raw) - 1))
        raw[place : place + data.draw(st.integers(0, 3))] = data.draw(st.binary(max_size=4))
    (tmp_path / name).write_bytes(bytes(raw[: data.draw(st.integers(1, len(raw)))]))
    check(tmp_path / name)


@fuzz
@given(raw=st.binary(max_size=200))
def test_random_bytes(tmp_path, raw):
    (tmp_path / "r.urdf").write_bytes(raw)
    assert check(tmp_path / "r.urdf") & {"XML001", "XML002", "XML009"}


def link(name: str, inside: str = "") -> str:
    return f'<link name="{name}">{inside}</link>'


def joint(name: str, parent: str, child: str, kind: str = "revolute") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        '<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="9" velocity="9"/></joint>'
    )


def robot(*parts: str) -> str:
    return f'<robot name="r">{"".join(parts)}</robot>'


def mesh(file: str) -> str:
    shape = f'<geometry><mesh filename="{file}"/></geometry>'
    return f"<collision>{shape}</collision><visual>{shape}</visual>"


CHAIN = 10_000
BOMB = "<!DOCTYPE robot [<!ENTITY a 'aaaaaaaaaa'>{}]><robot name='&z;'>&z;</robot>".format(
    "".join(
        f"<!ENTITY {b} '{f'&{a};' * 10}'>" for a, b in zip("abcdefghi", "bcdefghiz", strict=True)
    )
)
NASTY_LINK = (
    '<inertial><origin xyz="{0} {0} {0}" rpy="{0} {0} {0}"/><mass value="{0}"/>'
    '<inertia ixx="{0}" ixy="{0}" ixz="{0}" iyy="{0}" iyz="{0}" izz="{0}"/></inertial>'
    '<collision><geometry><box size="{0} {0} {0}"/></geometry></collision>'
)

BY_HAND = {
    "loop": (robot(link("a"), link("b"), joint("j", "a", "b"), joint("k", "b", "a")), "TRE004"),
    "link-on-itself": (robot(link("a"), joint("j", "a", "a")), "TRE004"),
    "two-parents": (
        robot(link("a"), link("b"), link("c"), joint("j", "a", "c"), joint("k", "b", "c")),
        "TRE003",
    ),
    "long-chain": (
        robot(
            *(link(f"l{i}", NASTY_LINK.format(1)) for i in range(CHAIN)),
            *(joint(f"j{i}", f"l{i}", f"l{i + 1}") for i in range(CHAIN - 1)),
        ),
        "more than 50000 elements",
    ),
    "wide-star": (
        robot(
            *(link(f"l{i}", NASTY_LINK.format(1)) for i in range(2000)),
            *(joint(f"j{i}", "l0", f"l{i}") for i in range(1, 2000)),
        ),
        "INR003",
    ),
    "nan": (robot(link("a", NASTY_LINK.format("nan"))), "XML006"),
    "1e308": (robot(link("a", NASTY_LINK.format("1e308"))), "XML006"),
    "1e29": (robot(link("a", NASTY_LINK.format("1e29"))), ""),
    "empty": ("", "XML001"),
    "entity-bomb": (BOMB, "XML010"),
    "external-entity": (
        '<!DOCTYPE r [<!ENTITY e SYSTEM "/dev/zero">]><robot name="r">&e;</robot>',
        "XML010",
    ),
    "deep": ("<robot name='r'>" + "<link>" * 100_000, "XML001"),
    "many-attributes": ("<robot " + " ".join(f"a{i}='1'" for i in range(100_000)) + "/>", "XML001"),
    "long-name": (robot(link("a" * 1_000_000)), ""),
    "no-elements": ('<robot name="r"/>', "TRE006"),
    "names-of-nothing": (robot("<link/>", "<joint/>", "<link><collision/></link>"), "XML013"),
    "mesh-of-nothing": (robot(link("a", mesh("empty.stl"))), "MSH006"),
    "mesh-of-billions": (robot(link("a", mesh("billions.stl"))), "MSH006"),
    "mesh-that-is-a-folder": (robot(link("a", mesh("."))), ""),
    "mesh-that-is-a-pipe": (robot(link("a", mesh("pipe"))), ""),
    "mesh-that-never-ends": (robot(link("a", mesh("/dev/zero"))), ""),
    "mesh-around-the-corner": (robot(link("a", mesh("../" * 500 + "x.stl"))), "MSH001"),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with the files of BY_HAND."""
    folder = tmp_path_factory.mktemp("bad")
    for name, (text, _) in BY_HAND.items():
        (folder / f"{name}.urdf").write_text(text)
    (folder / "binary.urdf").write_bytes(bytes(range(256)) * 400)
    (folder / "empty.stl").write_bytes(b"")
    header = bytes(80) + struct.pack("<I", 4_000_000_000)
    (folder / "billions.stl").write_bytes(header + bytes(500))
    os.mkfifo(folder / "pipe")
    (folder / "large.urdf").write_text(robot("<!--" + "x" * 100 * 2**20 + "-->"))
    return folder


def run(*files: Path) -> tuple[int, str, str]:
    """Return exit code and output of check-robot; fails if it takes more than it may."""
    # Not what getrusage says: on Linux a process inherits the peak of the one that started it.
    watch = (
        "import re, resource, sys\n"
        "from pathlib import Path\n"
        f"resource.setrlimit(resource.RLIMIT_CPU, ({SECONDS}, {SECONDS}))\n"
        "from terrainkit_cli.main import main\n"
        "code = main(sys.argv[1:])\n"
        "peak = re.search(r'VmHWM:\\s*(\\d+) kB', Path('/proc/self/status').read_text())\n"
        "print('peak', int(peak[1]) * 1024, file=sys.stderr)\n"
        "sys.exit(code)"
    )
    paths = os.pathsep.join(path for path in sys.path if path)
    done = subprocess.run(
        [sys.executable, "-c", watch, "check-robot", *map(str, files), "--format", "json"],
        capture_output=True,
        text=True,
        errors="replace",
        timeout=6 * SECONDS,  # for a process that waits; the limit of CPU time ends a busy one
        env=os.environ | {"PYTHONPATH": paths},
        cwd=files[0].parent,
        check=False,
    )
    assert int(done.stderr.split("peak ")[-1]) < BYTES
    return done.returncode, done.stdout, done.stderr


LARGE = [
    "long-chain", "wide-star", "entity-bomb", "external-entity", "deep", "many-attributes",
    "long-name", "mesh-of-billions", "mesh-that-never-ends", "large",
]  # fmt: skip
SMALL = [name for name in [*BY_HAND, "binary"] if name not in LARGE]


@pytest.fixture(scope="module")
def small_outputs(folder):
    """Return exit code, report and errors of each small file; one process checks all of them."""
    code, out, err = run(*(folder / f"{name}.urdf" for name in SMALL))
    return {name: (code, line, err) for name, line in zip(SMALL, out.splitlines(), strict=True)}


def assert_is_finding(name, code, out, err):
    assert code in (0, 1)
    assert "Traceback" not in err
    assert INTERNAL_ERROR not in out
    expected = {"binary": "XML001", "large": "XML001"}.get(name) or BY_HAND[name][1]
    assert expected in out


@pytest.mark.parametrize("name", SMALL)
def test_bad_file_is_a_finding(small_outputs, name):
    assert_is_finding(name, *small_outputs[name])


@pytest.mark.parametrize("name", LARGE)
def test_large_file_is_a_finding(folder, name):
    assert_is_finding(name, *run(folder / f"{name}.urdf"))


@pytest.mark.parametrize("name", ["no-such-file", "no-robots", "pipe", "locked.urdf"])
def test_open_error_is_one_line(folder, name):
    if name == "no-robots":
        (folder / name).mkdir()
    if name == "locked.urdf":
        if os.geteuid() == 0:
            pytest.skip("root may read every file")
        (folder / name).write_text("<robot/>")
        (folder / name).chmod(0)
    code, out, err = run(folder / name)
    assert code == 2
    assert out == ""
    assert err.splitlines()[0].startswith("terrainkit: error: ")
    assert len(err.splitlines()) == 2  # the other says what it took
