import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

import terrainkit_robots
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.fixes.edits import EditedBytes
from terrainkit_robots.mesh.mesh_cache import Meshes

QUADRUPED = Path(terrainkit_robots.__file__).parent / "description/bundled/quadruped/quadruped.xml"
THIGH = 'fullinertia="0.00584 0.0058 0.00103 8.72e-05 -0.000289 0.000808"'

ARM = """<mujoco model="arm">
  <worldbody>
    <body name="base">
      <geom type="box" size="0.1 0.1 0.05" mass="3"/>
      <body name="tip" pos="0 0 0.1">
        <joint name="turn" axis="0 1 0" range="-60 60"/>
        <inertial pos="0 0 0.2" mass="1" {inertia}/>
        <geom type="box" size="0.035 0.035 0.2" pos="0 0 0.2"/>
      </body>
    </body>
  </worldbody>
</mujoco>"""


@pytest.fixture
def repaired(tmp_path):
    """Return the fixed inertia of a link, and the attributes that the fix sets or removes."""

    def make(text, link):
        path = tmp_path / "robot.xml"
        path.write_text(text)
        facts = Facts(load_robot(path), Meshes())
        fix = facts.inertia_repair.fix(facts.tree.links[link])
        assert fix is not None
        edited = EditedBytes(path.read_bytes())
        edited.apply(edited.prepare(fix.edits))
        data = edited.result()
        model = mujoco.MjModel.from_xml_string(data.decode())
        body = model.body(link)
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, body.iquat)
        turn = turn.reshape(3, 3)
        return turn @ np.diag(body.inertia) @ turn.T, [edit.name for edit in fix.edits]

    return make


@pytest.mark.parametrize(
    ("axes", "removed"),
    [
        ("", []),
        ('quat="1 0 0 0"', ["quat"]),
        ('quat="0.5 0.5 0.5 0.5"', ["quat"]),
        ('euler="0 0.3 0"', ["euler"]),
        ('zaxis="1 0 1"', ["zaxis"]),
    ],
)
def test_fix_takes_inertia_of_mirror_image(repaired, axes, removed):
    text = QUADRUPED.read_text()
    sound = mujoco.MjModel.from_xml_string(text).body("FL_thigh")
    assert THIGH in text
    broken = text.replace(THIGH, f'{axes} diaginertia="0.00584 -0.0058 0.00103"', 1)
    inertia, names = repaired(broken, "FL_thigh")
    assert names == ["fullinertia", "diaginertia", *removed]
    np.testing.assert_allclose(np.linalg.eigvalsh(inertia), np.sort(sound.inertia), rtol=1e-4)
    assert inertia[0, 1] == pytest.approx(8.72e-05)
    assert inertia[0, 2] == pytest.approx(-0.000289)
    assert inertia[1, 2] == pytest.approx(0.000808)


@pytest.mark.parametrize("axes", ["", 'quat="0.5 0.5 0.5 0.5"'])
def test_fix_keeps_diagonal_inertia_diagonal(repaired, axes):
    text = ARM.format(inertia=f'{axes} diaginertia="0.014 0.003 0.004"')
    inertia, names = repaired(text, "tip")
    assert names == ["diaginertia"]
    moments = np.linalg.eigvalsh(inertia)
    assert moments[0] + moments[1] >= moments[2] * (1 - 1e-9)


def test_fix_writes_rotated_box_in_full(repaired):
    text = ARM.format(inertia='quat="1 0 0 1" diaginertia="0 0 0"')
    inertia, names = repaired(text, "tip")
    assert names == ["diaginertia"]
    assert inertia[2, 2] < inertia[0, 0]
    aslant = ARM.format(inertia='quat="0.9 0 0.3 0.1" diaginertia="0 0 0"')
    again, names = repaired(aslant, "tip")
    assert names == ["fullinertia", "diaginertia", "quat"]
    np.testing.assert_allclose(again, inertia, rtol=1e-4, atol=1e-9)


def test_fix_keeps_full_inertia_full(repaired):
    text = ARM.format(inertia='fullinertia="0.009 0.009 0.002 0.01 0 0"')
    _, names = repaired(text, "tip")
    assert names == ["fullinertia"]
    diagonal = ARM.format(inertia='fullinertia="0.014 0.003 0.004 0 0 0"')
    _, names = repaired(diagonal, "tip")
    assert names == ["fullinertia"]


def test_fix_of_derived_inertia_is_none(tmp_path):
    path = tmp_path / "robot.xml"
    path.write_text(ARM.format(inertia='diaginertia="1 1 1"'))
    facts = Facts(load_robot(path), Meshes())
    assert facts.inertia_repair.fix(facts.tree.links["base"]) is None


def urdf_fix(left, right=(), right_mass="1.152"):
    """Return the fix of FL_thigh: what it takes, and the six values that it writes.

    Args:
        left: Changed attributes of its inertia.
        right: Changed attributes of FR_thigh, its mirror image.
        right_mass: Mass of FR_thigh [kg].
    """
    path = QUADRUPED.with_suffix(".urdf")
    text = path.read_text()
    for link, changes in (("FL_thigh", dict(left)), ("FR_thigh", dict(right))):
        start = text.index(f'<link name="{link}">')
        end = text.index("</inertial>", start)
        block = text[start:end]
        for name, value in changes.items():
            block = re.sub(rf'{name}="[^"]*"', f'{name}="{value}"', block)
        if link == "FR_thigh":
            block = block.replace('mass value="1.152"', f'mass value="{right_mass}"')
        text = text[:start] + block + text[end:]
    facts = Facts(load_robot(path, contents={path: text.encode()}), Meshes())
    fix = facts.inertia_repair.fix(facts.tree.links["FL_thigh"])
    taken = fix.description.removeprefix("Replace the inertia of link FL_thigh by ")
    return taken, {edit.name: float(edit.value) for edit in fix.edits}


NAMES = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
MIRRORED = dict(zip(NAMES, (0.00584, 0.0058, 0.00103, 8.72e-05, -0.000289, 0.000808), strict=True))
# 1.152 kg / 12 times the squares of the sides 0.034, 0.0245 and 0.213 m.
BOX = dict(zip(NAMES, (0.00441305, 0.00446640, 0.00016860, 0.0, 0.0, 0.0), strict=True))


@pytest.mark.parametrize("right_mass", ["1.152", "1.13"])
def test_urdf_fix_mirrors_the_signs_of_products(right_mass):
    taken, values = urdf_fix({"iyy": -0.0058}, right_mass=right_mass)
    assert taken == "the inertia of its mirror image."
    assert values == pytest.approx(MIRRORED)


@pytest.mark.parametrize(
    ("right", "mass"),
    [
        ({"izz": 0.5}, "1.152"),  # violates the triangle inequality
        ({"izz": -0.001}, "1.152"),
        ({}, "1.129"),  # 2 % lighter
        ({}, "0"),
    ],
)
def test_urdf_fix_takes_no_invalid_mirror_image(right, mass):
    taken, values = urdf_fix({"ixx": 0.0075}, right, mass)
    assert taken == "the nearest physical inertia."
    assert values["ixx"] == pytest.approx(0.0075, rel=0.1)


@pytest.mark.parametrize("left", [dict.fromkeys(NAMES, 0), {"ixx": 5}])
def test_urdf_fix_takes_the_box_of_the_shapes_at_last(left):
    taken, values = urdf_fix(left, {"izz": 0.5})
    assert taken == "the inertia of a solid box around the body."
    assert values == pytest.approx(BOX, rel=1e-3, abs=1e-9)


def test_links_without_inertia_have_no_fix(tmp_path):
    path = tmp_path / "robot.urdf"
    bare = '<link name="b"><inertial><mass value="1"/></inertial></link>'
    path.write_text(f'<robot name="r"><link name="a"/>{bare}</robot>')
    facts = Facts(load_robot(path), Meshes())
    for link in facts.model.links:
        assert facts.inertia_repair.fix(link) is None
        assert facts.inertia_repair.relative_change(link) == np.inf
