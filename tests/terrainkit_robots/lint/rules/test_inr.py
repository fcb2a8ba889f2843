import mujoco
import numpy as np
import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.inertia.physical import triangle_ratio
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.rule import get_rule, rules
from terrainkit_robots.mesh.mesh_cache import Meshes
from tests.small_robots import ball, box, joint, link, shape

MOMENTS = {"ixx": 0.014, "iyy": 0.0136, "izz": 0.0008}


@pytest.fixture
def arm(tmp_path):
    """Return a function that writes an arm of 1 kg with changed values."""

    def write(**changed):
        values = {"mass": 1, "more": "", "visual": ""} | MOMENTS | changed
        six = "{ixx} {iyy} {izz} 0 0 0".format(**values)
        shapes = box("0.06 0.08 0.4", "0 0 0.2"), values["visual"]
        tip = link("tip", *shapes, mass=values["mass"], center="0 0 0.2", inertia=six)
        turn = joint("base", "tip", axis="0 0 1", limits=(-1, 1))
        path = tmp_path / "arm.urdf"
        arm = link("base", mass=None) + turn + tip + values["more"]
        path.write_text(f'<robot name="arm">{arm}</robot>')
        return path

    return write


def check(path):
    """Return code and severity of the errors and warnings of the INR rules."""
    facts = Facts(load_robot(path))
    return [
        (rule.code, violation.severity)
        for rule in rules()
        if rule.family == "INR"
        for violation in rule.findings(facts)
        if violation.severity != "note"
    ]


def test_inr_reads_no_visual_mesh(arm, monkeypatch):
    monkeypatch.setattr(Meshes, "vertices", lambda *_: pytest.fail("read"))
    visual = shape('mesh filename="shell.stl"', kind="visual")
    assert check(arm(visual=visual)) == []


def test_triangle_inequality_tolerates_rounding_to_four_digits(arm):
    rng = np.random.default_rng(0)
    for digits in [3, 4] * 20:
        a, b = rng.uniform(0.1, 1.0, 2) * 1e-2
        rounded = [float(f"{value:.{digits}g}") for value in (a, b, a + b)]
        ratio = triangle_ratio(np.sort(rounded))
        codes = [code for code, _ in check(arm(mass=5, **dict(zip(MOMENTS, rounded, strict=True))))]
        assert ("INR004" in codes) == (ratio < 0.999)
        assert ratio > 0.999 or digits == 3


def test_inertia_rules_agree_with_mujoco(arm):
    rng = np.random.default_rng(1)
    rejected = 0
    for _ in range(30):
        moments = dict(zip(MOMENTS, rng.uniform(-0.002, 0.014, 3), strict=True))
        path = arm(**moments)
        codes = {code for code, _ in check(path)}
        if is_rejected := bool(codes & {"INR003", "INR004"}):
            with pytest.raises(ValueError, match="inertia"):
                mujoco.MjModel.from_xml_path(str(path))
        else:
            mujoco.MjModel.from_xml_path(str(path))
        rejected += is_rejected
    assert 5 < rejected < 25


def test_inferred_mass_agrees_with_mujoco(arm):
    cylinder = shape('cylinder radius="0.03" length="0.1"')
    hood = link("hood", cylinder, ball(0.02), mass=None) + joint("tip", "hood", kind="fixed")
    path = arm(more=hood)
    (violation,) = get_rule("INR011").findings(Facts(load_robot(path)))
    compiled = mujoco.MjModel.from_xml_path(str(path))
    assert violation.measured["added"] == pytest.approx(compiled.body_mass.sum() - 1.0)
    assert "got 0.316 kg, 31.6% of the declared 1 kg" in violation.message
