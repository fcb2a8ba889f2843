import mujoco
import numpy as np
import pytest

from terrainkit_robots.lint.check import check_robot
from terrainkit_robots.onboarding.onboard_options import OnboardOptions
from terrainkit_robots.onboarding.pipeline import onboard
from terrainkit_robots.spec.robot_arrays import Robot
from tests.small_robots import URDF, ball, box, facts, joint, link, shape

FOUR = [f"{x} {y} 0" for x in (0.2, -0.2) for y in (0.2, -0.2)]
TWO = ["0 0.2 0", "0 -0.2 0"]
ROUND, HEAVY = ".006 .006 .006 0 0 0", ".01 .01 .01 0 0 0"


def wheel_legs(places, end=None, **hinge):
    """Return the URDF of a robot with a body at the end of each leg: a wheel of 0.1 m."""
    end, hinge = end or body_at_axis(), {"kind": "continuous"} | hinge
    limb, parts = box("0.04 0.04 0.2", "0 0 -0.1"), [link("trunk", box("0.5 0.3 0.1"), mass=8)]
    for k, place in enumerate(places):
        segments = [link(f"{n}{k}", limb, center="0 0 -0.1", inertia=ROUND) for n in "ts"]
        parts += [*segments, end.replace("END", f"end{k}")]
        parts += [joint("trunk", f"t{k}", place, limits=(-2, 2))]
        parts += [joint(f"t{k}", f"s{k}", "0 0 -0.2", limits=(-2, 2))]
        parts += [joint(f"s{k}", f"end{k}", "0 0 -0.2", **hinge)]
    return f'<robot name="wheels">{"".join(parts)}</robot>'


def body_at_axis(form='cylinder radius="0.1" length="0.05"', center="0 0 0", rpy="1.5708 0 0"):
    """Return a link at the end of a leg, whose hinge turns about y."""
    return link("END", shape(form, center, rpy), center=center, inertia=ROUND)


@pytest.mark.parametrize(
    ("end", "hinge", "role"),
    [
        (body_at_axis(), {}, "wheel"),
        (body_at_axis('sphere radius="0.1"'), {}, "wheel"),
        (body_at_axis(), {"kind": "revolute", "limits": (-1e16, 1e16)}, "wheel"),
        (body_at_axis(), {"kind": "revolute", "limits": (-3.11, 3.11)}, "wheel"),  # a whole turn
        (body_at_axis(), {"kind": "revolute", "limits": (-3.09, 3.09)}, "ankle"),
        (body_at_axis(center="0 0 -0.05"), {}, "ankle"),  # the center of a foot below its ankle
        (body_at_axis('box size="0.2 0.1 0.04"', rpy="0 0 0"), {}, "ankle"),
        (body_at_axis('box size="0.1 0.05 0.1"', rpy="0 0 0"), {}, "ankle"),  # radii of 1 to 1.41
        (body_at_axis(rpy="0 0 0"), {}, "ankle"),  # a cylinder across the axis
        (link("END", inertia=ROUND), {}, "ankle"),  # without shapes
        (body_at_axis(center="0 0.5 0"), {}, "wheel"),  # along the axis
        (link("END", ball(0.02), center="0.1 0 0", inertia=HEAVY), {}, "wheel"),  # and its motor
        # Off the axis by a ninth of its radius, a ball has radii of 10/9 to 8/9: 1.25.
        (link("END", ball(0.02, "0 0 0.0022"), inertia=HEAVY), {}, "wheel"),
        (link("END", ball(0.02, "0 0 0.0023"), inertia=HEAVY), {}, "ankle"),
    ],
)
def test_wheel_is_round_and_turns_without_limits(end, hinge, role):
    legs = facts(wheel_legs(FOUR, end, **hinge)).legs
    assert {leg.roles[-1] for leg in legs} == {role}


def test_one_motor_bends_a_leg_of_four_bars_with_a_wheel():
    side = """<body name="SIDE_thigh" pos="0 Y 0.5"><joint name="SIDE_hip" axis="0 1 0"/>
      <geom size="0.03" fromto="0 0 0 0 0 -0.2" type="capsule"/>
      <body name="SIDE_shank" pos="0 0 -0.2"><joint name="SIDE_knee" axis="0 1 0"/>
        <geom size="0.03" fromto="0 0 0 0 0 -0.2" type="capsule"/>
        <body name="SIDE_rod" pos="0.1 0 0"><joint name="SIDE_rod" axis="0 1 0"/>
          <geom size="0.01" fromto="0 0 0 0 0 0.2" type="capsule"/></body>
        <body name="SIDE_end" pos="0 0 -0.2"><joint name="SIDE_axle" axis="0 1 0"/>
          <geom type="cylinder" size="0.1 0.02" euler="90 0 0"/></body></body></body>"""
    sides = [
        side.replace("SIDE", name).replace("Y", y) for name, y in (("p", "0.2"), ("q", "-0.2"))
    ]
    motors = "".join(f'<motor joint="{n}_{j}"/>' for n in "pq" for j in ("hip", "axle"))
    loops = "".join(f'<connect body1="{n}_rod" body2="trunk" anchor="0 0 0.2"/>' for n in "pq")
    text = f"""<mujoco><worldbody><body name="trunk"><freejoint/><geom type="box"
      size="0.2 0.15 0.05" pos="0 0 0.5"/>{"".join(sides)}</body></worldbody>
      <equality>LOOPS</equality><actuator>{motors}</actuator></mujoco>"""
    assert [leg.foot for leg in facts(text.replace("LOOPS", loops)).legs] == ["p_end", "q_end"]
    assert facts(text.replace("LOOPS", "")).legs == ()  # a trailing arm of a car


def test_pose_of_legs_with_wheels_about_x():
    robot = facts(wheel_legs(FOUR, body_at_axis(rpy="0 1.5708 0"), axis="1 0 0"))
    assert {leg.roles[-1] for leg in robot.legs} == {"wheel"}
    assert abs(robot.default_pose["s0_joint"]) > 0.1


def test_leg_ends_at_the_rim_of_the_wheel():
    robot = facts(wheel_legs(FOUR))
    assert [leg.roles for leg in robot.legs] == [("hip", "knee", "wheel")] * 4
    assert [leg.length for leg in robot.legs] == pytest.approx([0.5] * 4, abs=0.01)
    assert {robot.default_pose[f"end{k}_joint"] for k in range(4)} == {0.0}
    # The axis is 0.75 of the length below the hip, less the radius that the wheel adds.
    assert robot.stance.height == pytest.approx(0.375, abs=0.005)


def test_four_wheels_drive_at_the_commanded_speed(tmp_path):
    source = tmp_path / "robot.urdf"
    source.write_text(wheel_legs(FOUR))
    onboard(source, tmp_path / "out", OnboardOptions(render_images=False))
    robot = Robot.load(tmp_path / "out")
    assert robot.wheels.tolist() == [False, False, True] * 4
    assert robot.spec.foot_radius == pytest.approx(0.1, abs=1e-3)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "out/scene.xml"))
    data = mujoco.MjData(model)
    data.qpos[2], data.qpos[7:] = robot.spawn_height, robot.default_pose
    data.ctrl = np.where(robot.wheels, 1.0 / 0.1, robot.default_pose)  # 1 m/s
    mujoco.mj_step(model, data, nstep=1500)
    assert data.qvel[0] == pytest.approx(1.0, abs=0.05)


def test_robot_on_two_wheels_is_not_expected_to_stand():
    report = check_robot(URDF, contents={URDF: wheel_legs(TWO).encode()})
    assert not {"LEG006", "DYN002"} & {finding.code for finding in report.findings}
    skipped = {each.code: each.reason for each in report.skipped}
    assert skipped["DYN002"] == "it balances on its wheels"
