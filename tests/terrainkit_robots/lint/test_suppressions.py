import re
from pathlib import Path

import pytest

from terrainkit_robots.lint.suppressions import read_comments

NOTE = b"<!-- terrainkit: ignore INR002 x -->"
BODY = b"<body>\n%s\n<geom/>\n<body>\n<geom/>\n</body>\n<geom/>\n</body>"


def covered(data):
    """Return the lines of the elements that the comment in `data` covers; 0 is the file."""
    (comment,) = read_comments(Path("robot.urdf"), data)
    starts = [i for i, line in enumerate(data.split(b"\n"), 1) if re.search(rb"<[a-z]", line)]
    return [line for line in (0, *starts) if comment.applies_to(line)]


@pytest.mark.parametrize(
    ("data", "lines"),
    [
        (NOTE + b"\n<robot>\n<link/>\n</robot>", [0, 2]),
        (b"<robot>\n<link/>\n</robot>" + NOTE, [0, 1]),
        (b"<robot>\n<a/>\n%s\n<b>\n<c>\n<d/></c>\n<e/>\n</b>\n<f/></robot>" % NOTE, [4, 5, 6, 7]),
        (b"<robot>\n<link>\n<a/>\n" + NOTE + b"\n<b>\n<c/></b>\n</link></robot>", [2, 5, 6]),
        # The inner body, on lines 5 and 6, is a separate part.
        (b"<mujoco>\n" + BODY % NOTE + b"</mujoco>", [2, 4, 8]),
        (b"<mujoco><worldbody>\n<geom/>\n" + NOTE + b"\n<body/>\n</worldbody></mujoco>", [4]),
    ],
)
def test_comment_covers_lines(data, lines):
    assert covered(data) == lines


def test_comment_line_is_its_first():
    data = b"<robot>\n\n<!-- terrainkit:\n ignore INR002\n x -->\n</robot>"
    (comment,) = read_comments(Path("robot.urdf"), data)
    assert comment.line == 3


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"terrainkit",
        b"<!-- terrainkit: ignore INR002 x -->",
        b"<robot><!-- terrainkit",
        b"<robot><!-- terrainkit: ignore INR002 x",
        b"<robot><?terrainkit: ignore INR002?></robot>",
        b"<robot>terrainkit: ignore INR002 x</robot>",
        b"<!DOCTYPE r [<!ENTITY e '<!-- terrainkit: ignore INR002 x -->'>]><robot>&e;</robot>",
        "<robot><!-- terrainkit: ignore INR002 \udc80 --></robot>".encode("utf-8", "surrogatepass"),
        b"\x00\xff" * 100 + b"terrainkit",
    ],
    ids=lambda data: repr(data[:24]),
)
def test_malformed_data_is_accepted(data):
    list(read_comments(Path("robot.urdf"), data))
    assert list(read_comments(Path("no such file"))) == []


@pytest.mark.parametrize(
    "data",
    [
        b"<robot>" + NOTE * 100_000 + b"<link/></robot>",
        b"<robot><link/>" + b"<!---->" * 200_000 + NOTE * 2000 + b"</robot>",
        b"<robot>" + (b"<a>" + NOTE) * 200 + b"<b/>\n" * 100_000 + b"</a>" * 200 + b"</robot>",
        b"<body>" + NOTE * 1000 + b"<body/>\n" * 100_000 + b"</body>",
        b"<robot><!-- terrainkit: ignore " + b"A," * 1_000_000 + b"B x --></robot>",
        b"<robot><!--" + b" " * 5_000_000 + b"-->terrainkit</robot>",
    ],
    ids=["comments", "between", "nested", "bodies", "codes", "blanks"],
)
def test_large_data_is_bounded(data):
    assert len(list(read_comments(Path("robot.urdf"), data))) <= 1000
