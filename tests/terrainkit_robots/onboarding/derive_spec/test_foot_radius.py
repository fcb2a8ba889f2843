import pytest

from terrainkit_robots.onboarding.derive_spec.foot_radius import foot_radius


def test_foot_radius_of_spheres(bundled):
    assert foot_radius(bundled("quadruped.urdf")) == pytest.approx(0.022)
    assert foot_radius(bundled("quadruped.xml")) == pytest.approx(0.022)


@pytest.mark.parametrize(
    ("geometry", "radius"),
    [
        ('<box size="0.2 0.06 0.03"/>', 0.03),
        ('<cylinder radius="0.04" length="0.02"/>', 0.04),
        ('<sphere radius="0.05"/>', 0.05),
    ],
)
def test_foot_radius_of_other_shapes(bundled, tmp_path, geometry, radius):
    text = '<geometry><sphere radius="0.022"/></geometry>'
    facts = bundled("quadruped.urdf", (text, f"<geometry>{geometry}</geometry>"), tmp_path=tmp_path)
    assert foot_radius(facts) == pytest.approx(radius, rel=0.05)


def test_foot_radius_of_sole_is_half_width(bundled):
    facts = bundled("biped.urdf")
    shapes = [shape.geometry for shape in facts.body_of["left_ankle_roll_link"].collisions]
    (width,) = {shape.size[1] for shape in shapes if shape.shape == "box"}
    assert foot_radius(facts) == pytest.approx(width)


def test_foot_radius_without_legs_is_none(robot):
    assert foot_radius(robot('<robot name="r"><link name="a"/></robot>')) is None
