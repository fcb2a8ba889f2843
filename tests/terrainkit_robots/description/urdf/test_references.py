from pathlib import Path

import pytest

from terrainkit_robots.description.urdf import references
from tests.tables import read_table
from tests.terrainkit_robots.description.made_robots import read

TREE = """<link name="base"/><link name="foot"/><link name="leg1"/><joint name="ankle" type="fixed">
  <parent link="base"/><child link="foot"/></joint>"""


def told(inner, code="TRE010"):
    """Return message and subject of each problem."""
    problems = read(f'<robot name="r">{TREE}{inner}</robot>', Path("robot.urdf")).problems
    assert {each.code for each in problems} <= {code}
    return [(each.message, each.subject) for each in problems]


@pytest.mark.parametrize(("text", "place", "kind"), read_table(__file__, "names_that_do_not_exist"))
def test_names_that_do_not_exist_are_reported_once(text, place, kind):
    for known in {"link": ["base"], "joint": ["ankle"]}.get(kind, ["base", "ankle"]):
        assert told(text.format(known)) == []
    assert told(text.format("") + text.format("${x}"), "XML004")[1:] == []
    wrong = f"{place}: got nobody; expected a {kind} of the robot"
    assert told(text.format("nobody") * 2) == [(wrong, "nobody")]


@pytest.mark.parametrize(
    ("name", "suggestion"), [("fooot", " (did you mean foot?)"), ("leg2", ""), ("x", "")]
)
def test_similar_name_is_suggested_unless_its_number_differs(name, suggestion):
    ((message, _),) = told(f'<gazebo reference="{name}"/>')
    assert f"got {name}{suggestion};" in message


def test_number_of_suggestions_is_bounded(monkeypatch):
    wrong = '<gazebo reference="fooot"/><gazebo reference="bbase"/>'
    monkeypatch.setattr(references, "MAX_SUGGESTIONS", 1)
    assert ["did you mean" in message for message, _ in told(wrong)] == [True, False]
    monkeypatch.setattr(references, "MAX_COMPARED", 3)
    assert ["did you mean" in message for message, _ in told(wrong)] == [False, False]


def test_joint_with_two_simple_transmissions_is_reported():
    joint = '<joint name="ankle"/>'
    simple = f'<transmission type="a/SimpleTransmission">{joint}</transmission>'
    element = f"<transmission><type>SimpleTransmission</type>{joint}</transmission>"
    other = f'<transmission type="a/Differential">{joint}</transmission>'
    empty = '<transmission type="SimpleTransmission"/>'
    assert told(simple + other * 2 + empty * 2) == []
    message = (
        "joint of a <transmission>: got ankle, which another transmission drives; expected one "
        "transmission for each joint"
    )
    assert told(simple + element) == [(message, "ankle")]


@pytest.mark.parametrize(
    ("ratio", "is_valid"), [("-2", True), ("0", False), ("x", False), ("", False)]
)
def test_reductions_are_numbers_other_than_0(ratio, is_valid):
    text = f"<a><mechanicalReduction>{ratio}</mechanicalReduction></a>"
    for inner, subject in ('<joint name="ankle"/>', "ankle"), ("", "t"):
        message = (
            f"mechanicalReduction of the transmission of {subject}: got {ratio!r}; expected a "
            "ratio other than 0"
        )
        found = told(f'<transmission name="t">{inner}{text}</transmission>', "JNT024")
        assert found == ([] if is_valid else [(message, subject)])
