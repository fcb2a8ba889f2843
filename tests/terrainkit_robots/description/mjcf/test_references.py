import re

import pytest

from tests.terrainkit_robots.description.made_robots import codes, read

ROBOT = """<mujoco><asset><material name="m"/></asset><worldbody>{ground}
<body name="b"><joint name="j"/><geom name="g" size="1" material="m"/><site name="s"/>
<body name="c"><joint name="k"/><geom name="h" size="1"/></body></body></worldbody>
<tendon><fixed name="t"><joint joint="j" coef="1"/></fixed><spatial><site site="s"/>
<geom geom="g" sidesite="s"/><site site="s"/></spatial></tendon>
<equality><joint joint1="j" joint2="k"/><weld body1="b" body2="c"/><tendon tendon1="t" tendon2="t"/>
</equality><contact><exclude body1="b" body2="c"/><pair geom1="g" geom2="h"/></contact>
<actuator><motor joint="j"/><motor jointinparent="j"/><motor tendon="t"/><adhesion body="b"/>
<motor site="s" refsite="s"/><motor cranksite="s" slidersite="s" cranklength="1"/></actuator>
<sensor><accelerometer site="s"/><jointpos joint="j"/><tendonpos tendon="t"/></sensor></mujoco>"""

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
