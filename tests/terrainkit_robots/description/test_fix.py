from pathlib import Path

import pytest

from terrainkit_robots.description.fix import SetAttribute, WriteFile, make_fix
from terrainkit_robots.description.model import Source

FILE = Path("/robots/robot.urdf")
WRITE = WriteFile(path=Path("/robots/part.stl"), content=bytes)


def edit(element):
    return SetAttribute(source=Source(file=FILE, line=1, element=element), name="a", value="1")


def test_make_fix_keeps_the_edits():
    made = make_fix("unsafe", "Write a mesh.", [WRITE, edit(0)])
    assert (made.safety, made.description) == ("unsafe", "Write a mesh.")
    assert made.edits == (WRITE, edit(0))


@pytest.mark.parametrize("edits", [None, [], [edit(None)], [WRITE, edit(0), edit(None)]])
def test_make_fix_needs_editable_elements(edits):
    assert make_fix("safe", "Set a to 1.", edits) is None
