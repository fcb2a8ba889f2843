import re

import pytest

from tests.tables import read_table
from tests.terrainkit_robots.description.made_robots import codes, read

ROBOT = read_table(__file__, "robot")

FLOOR = '<geom name="floor" type="plane" size="1 1 1"/>'
KINDS = {"j": "joint", "k": "joint", "b": "body", "c": "body", "g": "geom", "h": "geom"}
KINDS |= {"s": "site", "t": "tendon", "m": "material"}
REFERENCES = [
    match
    for match in re.finditer(r'(\w+)="([jkbcghstm])"', ROBOT)
    if match[1] not in ("name", "geom")
]


def unknown(text, ground=FLOOR):
    """Return what is said about the references to names that do not exist."""
    problems = read(text.format(ground=ground)).problems
    assert all((each.code, each.subject) == ("XML011", "nobody") for each in problems)
    return [each.message for each in problems]


def test_names_that_exist_are_not_reported():
    assert unknown(ROBOT) == []


@pytest.mark.parametrize("match", REFERENCES, ids=[match[1] for match in REFERENCES])
def test_names_that_do_not_exist_are_reported(match):
    """Each reference is replaced in turn."""
    tag = re.findall(r"<(\w+)", ROBOT[: match.start()])[-1]
    (message,) = unknown(ROBOT[: match.start(2)] + "nobody" + ROBOT[match.end(2) :])
    assert message == (
        f"{match[1]} of <{tag}>: got 'nobody'; expected the name of a {KINDS[match[2]]}; "
        "MuJoCo rejects the file"
    )


@pytest.mark.parametrize("name", ['geom2="h"', 'tendon="t"/></sensor'])
def test_names_that_a_scene_may_have_are_not_compared(name):
    text = ROBOT.replace(name, re.sub('".*?"', '"nobody"', name))
    assert len(unknown(text)) == 1
    assert unknown(text, ground="") == []


def test_names_in_a_file_without_bodies_are_not_compared():
    actuator = '<mujoco><actuator><motor joint="nobody"/></actuator></mujoco>'
    assert "XML011" not in codes(read(actuator))
