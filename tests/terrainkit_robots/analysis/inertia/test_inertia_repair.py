import re

import mujoco
import numpy as np
import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.fixes.edits import EditedBytes
from tests.small_robots import facts, link
from tests.tables import read_table

QUADRUPED = bundled.urdf_path("quadruped")
THIGH = 'fullinertia="0.00584 0.0058 0.00103 8.72e-05 -0.000289 0.000808"'

ARM = """<mujoco><worldbody><body name="base"><geom type="box" size="0.1 0.1 0.05" mass="3"/>
  <body name="tip" pos="0 0 0.1">
    <joint name="turn" axis="0 1 0" range="-60 60"/>
    <inertial pos="0 0 0.2" mass="1" {}/>
    <geom type="box" size="0.035 0.035 0.2" pos="0 0 0.2"/>
  </body></body></worldbody></mujoco>"""


@pytest.fixture
def repaired(tmp_path):
    """Return the fixed inertia of a link, and the attributes that the fix sets or removes."""

    def make(text, name="tip"):
        path = tmp_path / "robot.xml"
        path.write_text(text)
        robot = Facts(load_robot(path))
        fix = robot.inertia_repair.fix(robot.tree.links[name])
        edited = EditedBytes(path.read_bytes())
        edited.apply(edited.prepare(fix.edits))
        body = mujoco.MjModel.from_xml_string(edited.result().decode()).body(name)
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, body.iquat)
        turn = turn.reshape(3, 3)
        return turn @ np.diag(body.inertia) @ turn.T, [edit.name for edit in fix.edits]

    return make


@pytest.mark.parametrize(("axes", "removed"), read_table(__file__, "fix_takes_inertia_of_mirror"))
def test_fix_takes_inertia_of_mirror_image(repaired, axes, removed):
    text = QUADRUPED.with_suffix(".xml").read_text()
    assert THIGH in text
    broken = text.replace(THIGH, f'{axes} diaginertia="0.00584 -0.0058 0.00103"', 1)
    inertia, names = repaired(broken, "FL_thigh")
    assert names == ["fullinertia", "diaginertia", *removed]
    elements = [inertia[k] for k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    assert elements == pytest.approx(list(MIRRORED.values()), rel=1e-4)


@pytest.mark.parametrize(
    ("given", "changed"),
    [
        ('diaginertia="0.014 0.003 0.004"', ["diaginertia"]),
        ('quat="0.5 0.5 0.5 0.5" diaginertia="0.014 0.003 0.004"', ["diaginertia"]),
        ('fullinertia="0.009 0.009 0.002 0.01 0 0"', ["fullinertia"]),
        ('fullinertia="0.014 0.003 0.004 0 0 0"', ["fullinertia"]),
    ],
)
def test_fix_keeps_the_form_of_an_inertia(repaired, given, changed):
    inertia, names = repaired(ARM.format(given))
    assert names == changed
    moments = np.linalg.eigvalsh(inertia)
    assert moments[0] + moments[1] >= moments[2] * (1 - 1e-9)


def test_fix_writes_rotated_box_in_full(repaired):
    # 1 kg / 12 times the squares of the sides of 0.07, 0.07 and 0.4 m, also in a frame aslant.
    expected = np.diag([0.1649, 0.1649, 0.0098]) / 12
    for axes, changed in (
        ("1 0 0 1", ["diaginertia"]),
        ("0.9 0 0.3 0.1", ["fullinertia", "diaginertia", "quat"]),
    ):
        inertia, names = repaired(ARM.format(f'quat="{axes}" diaginertia="0 0 0"'))
        np.testing.assert_allclose(inertia, expected, rtol=1e-4, atol=1e-9)
        assert names == changed


def test_derived_and_missing_inertias_have_no_fix():
    robot = facts(ARM.format('diaginertia="1 1 1"'))
    assert robot.inertia_repair.fix(robot.tree.links["base"]) is None
    bare = '<link name="b"><inertial><mass value="1"/></inertial></link>'
    robot = facts(link("a", mass=None), bare)
    for each in robot.model.links:
        assert robot.inertia_repair.fix(each) is None
        assert robot.inertia_repair.relative_change(each) == np.inf


def urdf_fix(left, right):
    """Return the fix of FL_thigh: what it takes, and the six values that it writes.

    Args:
        left: Changed attributes of its inertial.
        right: Changed attributes of FR_thigh, its mirror image; `value` is the mass.
    """
    text = QUADRUPED.read_text()
    for name, changes in (("FL_thigh", left), ("FR_thigh", right)):
        start = text.index(f'<link name="{name}">')
        end = text.index("</inertial>", start)
        block = text[start:end]
        for key, value in changes.items():
            block, count = re.subn(rf'\b{key}="[^"]*"', f'{key}="{value}"', block)
            assert count == 1
        text = text[:start] + block + text[end:]
    robot = facts(text)
    fix = robot.inertia_repair.fix(robot.tree.links["FL_thigh"])
    taken = fix.description.removeprefix("Replace the inertia of link FL_thigh by ")
    return taken, {edit.name: float(edit.value) for edit in fix.edits}


NAMES = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
MIRRORED = dict(zip(NAMES, (0.00584, 0.0058, 0.00103, 8.72e-05, -0.000289, 0.000808), strict=True))
# 1.152 kg / 12 times the squares of the sides 0.034, 0.0245 and 0.213 m.
BOX = dict(zip(NAMES, (0.00441305, 0.00446640, 0.00016860, 0.0, 0.0, 0.0), strict=True))


@pytest.mark.parametrize(("mass", "scale"), [(1.152, 1), (1.13, 1), (1.28, 0.9)])
def test_urdf_fix_mirrors_the_signs_of_products(mass, scale):
    taken, values = urdf_fix({"iyy": -0.0058}, {"value": mass})
    more = "" if scale == 1 else f", times {scale} as its mass is"
    assert taken == f"the inertia of its mirror image FR_thigh{more}."
    assert values == pytest.approx({name: scale * value for name, value in MIRRORED.items()})


# Of which the first violates the triangle inequality, and the third is 21 % lighter.
@pytest.mark.parametrize("right", [{"izz": 0.5}, {"izz": -0.001}, {"value": 0.95}, {"value": 0}])
def test_urdf_fix_takes_no_invalid_mirror_image(right):
    taken, values = urdf_fix({"ixx": 0.0075}, right)
    assert taken == "the nearest physical inertia."
    assert values["ixx"] == pytest.approx(0.0075, rel=0.1)


@pytest.mark.parametrize("left", [dict.fromkeys(NAMES, 0), {"ixx": 5}])
def test_urdf_fix_takes_the_box_of_the_shapes_at_last(left):
    taken, values = urdf_fix(left, {"izz": 0.5})
    assert taken == "the inertia of a solid box around the body."
    assert values == pytest.approx(BOX, rel=1e-3, abs=1e-9)


@pytest.mark.parametrize(
    ("inertia", "change"),
    [
        ("1 1.2 1.4 0 0 0", 0.0),
        # The second moments 0.5, 0.5 and -0.25 become 0.5, 0.5 and 0.0005: 0.2505 over 0.25.
        ("0.25 0.25 1 0 0 0", 1.002),
        ("-1 -1.2 -1.4 0 0 0", np.inf),
    ],
)
def test_relative_change_of_a_fix(inertia, change):
    robot = facts(link("a", inertia=inertia))
    found = robot.inertia_repair.relative_change(robot.model.links[0])
    assert found == pytest.approx(change, abs=1e-12)
