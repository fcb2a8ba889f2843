from itertools import pairwise

import mujoco
import numpy as np
import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.export.canonical import to_canonical
from terrainkit_robots.export.mjcf import Extras, mjcf_text
from terrainkit_robots.export.urdf import urdf_text
from terrainkit_robots.quiet_mujoco import quiet_mujoco

INERTIA = '<mass value="{}"/><inertia ixx="{}" iyy="{}" izz="{}" ixy="0" ixz="0" iyz="0"/>'
TRUNK = INERTIA.format(60, 1.5, 8.5, 9.2)
ZERO, NONE = INERTIA.format("{}", 0, 0, 0), '<mass value="{}"/>'
TURNED = '<origin xyz="0.1 0 0.2" rpy="0.3 0.5 0.7"/>'


def urdf(links, kind="fixed"):
    """Return a robot of links, each joined to the one before."""
    inside = "".join(
        f'<link name="{name}"><inertial>{inertial}</inertial></link>'
        for name, inertial in links.items()
    )
    joints = "".join(
        f'<joint name="{child}_joint" type="{kind}"><parent link="{parent}"/>'
        f'<child link="{child}"/>{TURNED}</joint>'
        for parent, child in pairwise(links)
    )
    return f'<robot name="r">{inside}{joints}</robot>'


def compiled(form):
    """Return what MuJoCo makes of both files."""
    with quiet_mujoco():
        return [
            mujoco.MjModel.from_xml_string(text)
            for text in (urdf_text(form.model), mjcf_text(form.model, Extras()))
        ]


TINY = INERTIA.format(0.5, *["5e-15"] * 3)
"""MuJoCo rejects moments below 1e-14 kg m2."""


@pytest.mark.parametrize("sensor", [ZERO.format(0.5), NONE.format(0.5), TINY])
@pytest.mark.parametrize("order", [("trunk", "imu"), ("imu", "trunk")])
def test_mass_without_inertia_moves_to_heaviest_link(sensor, order, robot):
    facts = robot(urdf({name: {"trunk": TRUNK, "imu": sensor}[name] for name in order}))
    form = to_canonical(facts, floating=True)
    links = {link.name: link.inertial for link in form.model.links}
    assert (links["imu"], links["trunk"].mass) == (None, 60.5)
    assert form.changes == (
        "moved the mass of imu to trunk, to which they are fixed: MuJoCo rejects masses without "
        "inertia",
    )
    after = Facts(form.model).bodies[0]
    if "inertia" in sensor:
        before = facts.bodies[0]
        assert np.allclose(after.center, before.center)
        assert np.allclose(after.inertia, before.inertia)
    assert [made.body_mass.sum() for made in compiled(form)] == pytest.approx([60.5] * 2)


def test_invalid_body_is_unchanged(robot):
    wrong = INERTIA.format(2, 0.01, 0.01, 1)
    form = to_canonical(robot(urdf({"a": wrong, "b": ZERO.format(1)})), floating=True)
    assert form.changes == ()
    assert [link.inertial.mass for link in form.model.links] == [2, 1]
    assert form.model.links[0].inertial.inertia[2, 2] == 1


def test_single_mass_without_inertia(robot):
    text = urdf({"base": NONE.format(5), "arm": TRUNK}, "continuous")
    form = to_canonical(robot(text), floating=False)
    assert form.changes == ()
    assert not form.model.links[0].inertial.inertia.any()
    for made in compiled(form):
        assert made.body_mass.sum() == pytest.approx(65)
        assert not made.body("base").inertia.any()


def test_turned_and_rounded_plate(robot):
    plate = TURNED + INERTIA.format(2, 0.010004, 0.02, 0.03001)
    facts = robot(urdf({"plate": plate}))
    form = to_canonical(facts, floating=True)
    assert form.changes == ()
    before, after = facts.bodies[0].principal, Facts(form.model).bodies[0].principal
    assert after == pytest.approx(before, rel=1e-3)
    compiled(form)


@pytest.mark.parametrize(
    ("iyy", "expected"),
    [
        # (ixx + iyy) / izz is 0.9933, 0.9867 and 1.0033; the limit is 0.99.
        (0.0198, (0.0101, 0.0199, 0.03)),
        (0.0196, (0.01, 0.0196, 0.03)),
        (0.0201, (0.01, 0.0201, 0.03)),
    ],
)
def test_only_small_violations_are_rounding(iyy, expected, robot):
    facts = robot(urdf({"plate": INERTIA.format(2, 0.01, iyy, 0.03)}))
    (plate,) = to_canonical(facts, floating=True).model.links
    assert np.diag(plate.inertial.inertia) == pytest.approx(expected, abs=1e-7)
