"""A quadruped whose legs are five-bar linkages keeps its loops, stands and can be trained."""

import re

import mujoco
import numpy as np
import pytest

from terrainkit_robots.onboarding.onboard_options import OnboardOptions
from terrainkit_robots.onboarding.pipeline import onboard
from terrainkit_robots.onboarding.statements import summarize
from terrainkit_robots.rl.env import make_env
from terrainkit_robots.rl.tasks import default_task
from terrainkit_robots.rl.terrain import Plane
from terrainkit_robots.spec.robot_arrays import Robot

# Both branches of a leg end 0.24 m below the middle of their hips, 0.03 m to each side.
LEG = """
<body name="{leg}_{side}_upper" pos="{x} {y} 0" euler="0 {tilt} 0">
  <joint name="{leg}_{side}_hip" axis="0 1 0" range="-1 1" armature="0.005" damping="0.05"/>
  <geom type="capsule" fromto="0 0 0 0 0 -0.13" size="0.01" mass="0.25" contype="0"
    conaffinity="0"/>
  <body name="{leg}_{side}_lower" pos="0 0 -0.13" euler="0 {bend} 0">
    <joint name="{leg}_{side}_knee" axis="0 1 0" range="-1 1" damping="0.02" armature="0.001"/>
    <geom type="capsule" fromto="0 0 0 0 0 -{length}" size="0.008" mass="0.12" contype="0"
      conaffinity="0"/>{foot}
  </body>
</body>"""
FOOT = '<geom type="sphere" size="0.018" pos="0 0 -{}" mass="0.03"/>'


def five_bar_text():
    drop, reach = 0.24, 0.03
    knee = np.array([0.13 * np.sin(0.6) + reach, 0.13 * np.cos(0.6)])
    rod = np.array([knee[0], drop - knee[1]])
    length, angle = float(np.hypot(*rod)), float(np.arctan2(*rod))
    bodies, joints, loops = [], [], []
    for leg, x, y in (
        ("FL", 0.18, 0.1),
        ("FR", 0.18, -0.1),
        ("RL", -0.18, 0.1),
        ("RR", -0.18, -0.1),
    ):
        for side, sign in (("front", 1), ("back", -1)):
            values = {"x": x + sign * reach, "y": y, "tilt": -0.6 * sign}
            values |= {"bend": (0.6 + angle) * sign, "length": length}
            foot = FOOT.format(length) if sign > 0 else ""
            bodies.append(LEG.format(leg=leg, side=side, foot=foot, **values))
            joints.append(f"{leg}_{side}_hip")
        ends = f'body1="{leg}_front_lower" body2="{leg}_back_lower"'
        loops.append(f'<connect {ends} anchor="0 0 -{length}"/>')
    motors = (f'<motor joint="{joint}" ctrlrange="-20 20"/>' for joint in joints)
    return (
        '<mujoco model="fivebar"><compiler angle="radian"/><worldbody><body name="trunk" '
        'pos="0 0 0.3"><freejoint/><geom type="box" size="0.2 0.08 0.04" mass="6"/>'
        f"{''.join(bodies)}</body></worldbody><equality>{''.join(loops)}</equality>"
        f"<actuator>{''.join(motors)}</actuator></mujoco>"
    )


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fivebar")
    (folder / "fivebar.xml").write_text(five_bar_text())
    options = OnboardOptions(render_images=False)
    return onboard(folder / "fivebar.xml", folder / "out", options)


def test_five_bar_legs_stand_with_their_loops(result):
    checks = result.verification
    assert [leg.foot for leg in result.robot.facts.legs] == [
        f"{leg}_front_lower" for leg in ("FL", "FR", "RL", "RR")
    ]
    assert (checks.differences, checks.failures) == ((), ())
    assert len(checks.responses) == 8
    assert all(response.failure == "" for response in checks.responses)


def test_loops_of_a_spec_close_a_urdf(result, tmp_path):
    # robot.urdf lost the loops, which robot.toml has.
    text = (result.folder / "robot.toml").read_text()
    loops = re.findall(r"\[\[loops\]\].*?\n\n", text, re.DOTALL)
    motors = f"joint_order = {list(result.robot.spec.joint_order)}\n"
    (tmp_path / "loops.toml").write_text(motors + "".join(loops))
    for spec in (result.folder / "robot.toml", tmp_path / "loops.toml"):
        options = OnboardOptions(
            render_images=False, spec=spec, frameworks=("genesis", "mjlab"), overwrite=True
        )
        again = onboard(result.folder / "robot.urdf", tmp_path / "out", options)
        said = dict(summarize(again))
        assert said["loops"].startswith("4 loops closed within 0.")
        assert "differs" not in said
        assert "robot.urdf, which genesis reads, has none" in said["loops"]
        assert said["standing"].startswith("yes: 5 s with the gains of robot.toml")
        assert again.robot.spec.joint_order == result.robot.spec.joint_order
        assert again.robot.spec.loops == result.robot.spec.loops


def test_training_starts_with_closed_loops(result):
    robot = Robot.load(result.folder)
    env = make_env(default_task(robot.spec), robot, Plane())
    assert env.num_actions == 8
    data = mujoco.MjData(env.scene.model)
    data.qpos[:] = env.scene.default_qpos
    mujoco.mj_forward(env.scene.model, data)
    is_loop = data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
    assert is_loop.sum() == 12
    assert np.abs(data.efc_pos[is_loop]).max() < 1e-4
