import re
from pathlib import Path

import pytest

from terrainkit_robots.description.load import load_robot

FILE = Path("/robots/robot.xml")
ROBOT = """<mujoco><asset><material name="m"/></asset><worldbody>{ground}
<body name="b"><joint name="j"/><geom name="g" size="1"{geom}/><site name="s"/>
<body name="c"><joint name="k"/><geom name="h" size="1"/></body></body></worldbody>
<tendon><fixed name="t"><joint joint="j" coef="1"/></fixed>{tendon}</tendon>
<{section}>{element}</{section}></mujoco>"""


GROUND = '<geom name="floor" type="plane" size="1 1 1"/>'


def unknown(section="visual", element="", tendon="", geom="", ground=GROUND):
    """Return what is said about the references to names that do not exist."""
    text = ROBOT.format(section=section, element=element, tendon=tendon, geom=geom, ground=ground)
    problems = load_robot(FILE, contents={FILE: text.encode()}).problems
    assert all((each.code, each.subject) == ("XML011", "nobody") for each in problems)
    return [each.message.removesuffix("; MuJoCo rejects the file") for each in problems]


@pytest.mark.parametrize(
    ("section", "element", "attributes", "kind"),
    [
        ("equality", '<joint joint1="j" joint2="k"/>', ("joint1", "joint2"), "joint"),
        ("equality", '<weld body1="b" body2="c"/>', ("body1", "body2"), "body"),
        ("equality", '<tendon tendon1="t" tendon2="t"/>', ("tendon1", "tendon2"), "tendon"),
        ("contact", '<exclude body1="b" body2="c"/>', ("body1", "body2"), "body"),
        ("contact", '<pair geom1="g" geom2="h"/>', ("geom1", "geom2"), "geom"),
        ("actuator", '<motor joint="j"/>', ("joint",), "joint"),
        ("actuator", '<motor jointinparent="j"/>', ("jointinparent",), "joint"),
        ("actuator", '<motor tendon="t"/>', ("tendon",), "tendon"),
        ("actuator", '<motor site="s" refsite="s"/>', ("site", "refsite"), "site"),
        (
            "actuator",
            '<motor cranksite="s" slidersite="s" cranklength="1"/>',
            ("cranksite", "slidersite"),
            "site",
        ),
        ("sensor", '<accelerometer site="s"/>', ("site",), "site"),
        ("sensor", '<jointpos joint="j"/>', ("joint",), "joint"),
        ("sensor", '<tendonpos tendon="t"/>', ("tendon",), "tendon"),
    ],
)
def test_names_that_do_not_exist_are_reported(section, element, attributes, kind):
    assert unknown(section, element) == []
    tag = element[1:].split()[0]
    for attribute in attributes:
        wrong = re.sub(rf' {attribute}="."', f' {attribute}="nobody"', element)
        expected = f"{attribute} of <{tag}>: got 'nobody'; expected the name of a {kind}"
        assert unknown(section, wrong) == [expected]


def test_names_in_tendons_and_geoms_are_reported():
    path = '<spatial><site site="s"/><geom geom="g" sidesite="{}"/><site site="{}"/></spatial>'
    assert unknown(tendon=path.format("s", "s")) == []
    assert unknown(tendon=path.format("nobody", "s")) == [
        "sidesite of <geom>: got 'nobody'; expected the name of a site"
    ]
    assert unknown(tendon=path.format("s", "nobody")) == [
        "site of <site>: got 'nobody'; expected the name of a site"
    ]
    assert unknown(geom=' material="m"') == []
    assert unknown(geom=' material="nobody"') == [
        "material of <geom>: got 'nobody'; expected the name of a material"
    ]


@pytest.mark.parametrize(
    ("section", "element"),
    [("contact", '<pair geom1="g" geom2="nobody"/>'), ("sensor", '<jointpos joint="nobody"/>')],
)
def test_names_that_a_scene_may_have_are_not_compared(section, element):
    assert len(unknown(section, element)) == 1
    assert unknown(section, element, ground="") == []


def test_names_in_a_file_without_bodies_are_not_compared():
    text = '<mujoco><actuator><motor joint="nobody"/></actuator></mujoco>'
    problems = load_robot(FILE, contents={FILE: text.encode()}).problems
    assert not any(each.code == "XML011" for each in problems)
