import math

import pytest

from terrainkit.errors import ConfigError
from terrainkit_robots.lint.check import lint_selected
from terrainkit_robots.lint.settings import Settings
from terrainkit_robots.onboarding.derive_spec.derive import derive_spec
from terrainkit_robots.spec.robot_spec import JOINT_TABLES, RobotSpec, unit_of
from tests.small_robots import facts, joint, link

ARM = "".join(
    (
        link("base"),
        *(link(name, mass=None) for name in ("lower", "upper", "follower")),
        joint("base", "lower", axis="0 0 1", limits=(0.5, 2.5)),
        joint("lower", "upper", kind="continuous"),
        joint("upper", "follower", limits=(-1, 1), more='<mimic joint="lower_joint"/>'),
    )
)


def derived(facts, gains, **changed):
    return derive_spec(facts, gains=gains(facts, **changed), floating=True)


def test_derive_spec_of_quadruped(bundled, gains):
    quadruped = bundled("quadruped.urdf")
    spec = derived(quadruped, gains)
    legs = ("FL", "FR", "RL", "RR")
    hip, thigh, calf = (f".*_{part}_joint" for part in ("hip", "thigh", "calf"))
    expected = {
        "joint_order": tuple(f"{leg}_{p}_joint" for leg in legs for p in ("hip", "thigh", "calf")),
        "base": "base",
        "feet": tuple(f"{leg}_foot" for leg in legs),
        "default_pose": {hip: 0.0, thigh: 0.75, calf: -1.5},
        "effort": {hip: 23.7, thigh: 23.7, calf: 45.43},
        "velocity": {hip: 30.1, thigh: 30.1, calf: 15.7},
        "base_height_target": round(quadruped.stance.height, 3),
        "spawn_height": round(quadruped.stance.height + 0.01, 3),
        "foot_radius": pytest.approx(0.022),
        "stance_width": pytest.approx(0.284, abs=1e-3),
        "urdf": "robot.urdf",
        "mjcf": "robot.xml",
        "floating": True,
    }
    assert {name: getattr(spec, name) for name in expected} == expected
    assert spec.soft_limits[hip] == (-0.942, 0.942)
    assert spec.per_joint("default_pose") == dict(quadruped.stance.positions)
    assert set(spec.mirror) == set(spec.joint_order)
    assert all(spec.mirror[twin.joint].joint == name for name, twin in spec.mirror.items())
    about = {name: spec.provenance[name].origin for name in ("effort", "default_pose", "mirror")}
    assert about == {"effort": "declared", "default_pose": "solved", "mirror": "measured"}
    assert spec.provenance["effort"].reason == "in quadruped.urdf"


def test_derive_spec_of_biped(bundled, gains):
    spec = derived(bundled("biped.urdf"), gains)
    assert spec.base == "pelvis"
    assert spec.feet == ("left_ankle_roll_link", "right_ankle_roll_link")
    assert spec.shanks == ("left_knee_link", "right_knee_link")
    assert spec.thighs == ("left_hip_yaw_link", "right_hip_yaw_link")
    assert spec.penalized_contacts == (*spec.thighs, *spec.shanks)


def test_derive_spec_without_legs(gains):
    spec = derived(facts(ARM), gains)
    assert spec.joint_order == ("lower_joint", "upper_joint")
    assert spec.feet == spec.shanks == spec.thighs == spec.penalized_contacts == ()
    assert spec.base_height_target is spec.spawn_height is spec.leg_length is None
    assert spec.stance_width is spec.foot_radius is None
    assert spec.default_pose == {"lower_joint": 0.5, "upper_joint": 0.0}
    assert spec.soft_limits == {"lower_joint": (0.5, 2.4)}  # the default pose is at the limit
    assert spec.reset_range == (1.0, 1.5)
    assert spec.provenance["default_pose"].origin == "suggested"
    assert RobotSpec.from_toml(spec.to_toml()) == spec


@pytest.mark.parametrize("name", ["quadruped.urdf", "quadruped.xml", "biped.urdf", "biped.xml"])
def test_derive_spec_passes_lint_rules(bundled, gains, name):
    spec = derived(bundled(name), gains)
    assert RobotSpec.from_toml(spec.to_toml()) == spec
    report = lint_selected(bundled(name, spec=spec), Settings(simulate=False))
    assert report.crashed == ()
    assert [f.message for f in report.findings if f.severity != "note"] == []
    for table in JOINT_TABLES:
        assert tuple(spec.per_joint(table)) == spec.joint_order
    numbers = [field for field in type(spec).__dataclass_fields__ if unit_of(field)]
    assert all(spec.provenance[field].reason for field in numbers)


def test_derive_spec_uses_keyframe(robot, gains):
    text = """<mujoco model="m"><worldbody><body name="trunk"><freejoint/>
        <geom type="box" size=".1 .1 .1"/>
        <body name="one"><joint name="a" axis="0 1 0"/><geom type="box" size=".1 .1 .1"/></body>
        </body></worldbody><keyframe><key qpos="0 0 1 1 0 0 0 0.3"/></keyframe></mujoco>"""
    spec = derived(robot(text), gains)
    assert spec.default_pose == {"a": 0.3}
    assert spec.provenance["default_pose"].origin == "declared"


def test_derive_spec_reset_range_is_within_limits(bundled, gains):
    quadruped = bundled("quadruped.urdf")
    spec = derived(quadruped, gains)
    limits = {each.name: each.range for each in quadruped.actuated}
    assert spec.reset_range != (0.5, 1.5)
    for name, position in spec.per_joint("default_pose").items():
        for factor in spec.reset_range:
            assert limits[name][0] <= factor * position <= limits[name][1]
    assert "calf_joint" in spec.provenance["reset_range"].reason


TRUNK = """<mujoco model="m"><compiler angle="radian"/><worldbody><body name="trunk" pos="0 0 0.8">
    <freejoint/><geom type="box" size=".1 .1 .1" mass="5"/>{legs}</body></worldbody></mujoco>"""
LEG = """<body name="thigh_{k}" pos="{x} {y} 0"><joint name="hip_{k}" axis="0 1 0" range="-2 2"/>
    <geom type="capsule" size=".03" fromto="0 0 0 0 0 -.4" mass="1"/>
    <body name="shank_{k}" pos="0 0 -.4"><joint name="knee_{k}" axis="0 1 0" range="0.9 2"/>
    <geom type="capsule" size=".03" fromto="0 0 0 0 0 -.4" mass="1"/></body></body>"""


@pytest.mark.parametrize(
    ("feet", "is_biped"),
    [
        ([(0, 0.1), (0, -0.1)], True),
        ([(0.2, 0.1), (0.2, -0.1), (-0.2, 0.1), (-0.2, -0.1)], False),
    ],
)
def test_derive_spec_resets_two_legs_near_the_default_pose(robot, gains, feet, is_biped):
    legs = "".join(LEG.format(k=k, x=x, y=y) for k, (x, y) in enumerate(feet))
    spec = derived(robot(TRUNK.format(legs=legs)), gains)
    assert len(spec.feet) == len(feet)
    most = max(abs(position) for position in spec.default_pose.values())
    assert most > 0.9  # the knees do not stretch further
    offset = (spec.reset_range[1] - 1) * most
    assert 0.23 < offset <= 0.25 if is_biped else offset > 0.4
    assert ("0.25 rad" in spec.provenance["reset_range"].reason) == is_biped


def test_derive_spec_rejects_missing_gains_and_bodies(gains):
    arm = facts(ARM)
    known = {"lower_joint": gains(arm)["lower_joint"]}
    with pytest.raises(ConfigError, match="gains of upper_joint are missing; expected all actuat"):
        derive_spec(arm, gains=known, floating=False)
    with pytest.raises(ConfigError, match="r has no bodies"):
        derive_spec(facts('<robot name="r"/>'), gains={}, floating=False)


@pytest.mark.parametrize("value", ["1e29", "1e-300", "-1"])
@pytest.mark.parametrize("old", ['effort="23.7"', 'radius="0.022"', 'lower="-2.7227"'])
def test_derive_spec_with_extreme_numbers(bundled, gains, tmp_path, old, value):
    new = f'{old.split("=")[0]}="{value}"'
    quadruped = bundled("quadruped.urdf", (old, new), tmp_path=tmp_path)
    spec = derived(quadruped, gains)
    assert RobotSpec.from_toml(spec.to_toml()) == spec
    assert all(math.isfinite(v) for table in JOINT_TABLES for v in getattr(spec, table).values())
