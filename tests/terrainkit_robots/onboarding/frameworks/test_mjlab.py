"""Tests of the configuration for mjlab, with stub modules and with mjlab if available."""

import os
import shutil
import subprocess
from pathlib import Path

import mujoco
import pytest

from terrainkit_robots.onboarding.frameworks.frameworks import config_text
from terrainkit_robots.quiet_mujoco import quiet_mujoco

PROBE = Path(__file__).with_name("mjlab_probe.py")


@pytest.fixture
def modules(stand_in):
    refusing = stand_in.refusing
    actuator = refusing(
        "BuiltinPositionActuatorCfg",
        "target_names_expr",
        "stiffness",
        "damping",
        **dict.fromkeys(("effort_limit", "armature", "frictionloss", "viscous_damping")),
    )
    rolling = refusing(
        "BuiltinVelocityActuatorCfg",
        "target_names_expr",
        "damping",
        **dict.fromkeys(("effort_limit", "armature", "frictionloss", "viscous_damping")),
    )
    entity = refusing(
        "EntityCfg", init_state=None, spec_fn=None, articulation=None, sort_actuators=False
    )
    entity.InitialStateCfg = refusing(
        "InitialStateCfg",
        pos=(0.0, 0.0, 0.0),
        rot=(1.0, 0.0, 0.0, 0.0),
        joint_pos={},
        joint_vel={},
    )
    articulation = refusing(
        "EntityArticulationInfoCfg", actuators=(), soft_joint_pos_limit_factor=1.0
    )
    return {
        "mjlab": stand_in.module("mjlab"),
        "mjlab.actuator": stand_in.module(
            "actuator",
            BuiltinPositionActuatorCfg=actuator,
            BuiltinVelocityActuatorCfg=rolling,
        ),
        "mjlab.entity": stand_in.module(
            "entity", EntityCfg=entity, EntityArticulationInfoCfg=articulation
        ),
    }


def test_mjlab_config_of_quadruped(load, modules, robots):
    spec = robots.quadruped()
    loaded = load("mjlab", spec, modules)
    entity = loaded.get_robot_cfg()
    assert entity is not loaded.get_robot_cfg()
    assert entity.init_state.pos == (0.0, 0.0, 0.3)
    assert entity.init_state.joint_pos["RR_calf_joint"] == -1.8
    assert entity.articulation.soft_joint_pos_limit_factor == 0.9
    found = {}
    for actuator in entity.articulation.actuators:
        for name in actuator.target_names_expr:
            assert name not in found
            found[name] = actuator
    assert set(found) == set(spec.joint_order)
    assert len(entity.articulation.actuators) == 2
    for field, calf, other in (
        ("stiffness", 30.0, 20.0),
        ("damping", 0.75, 0.5),
        ("effort_limit", 45.43, 23.7),
        ("armature", 0.04, 0.01),
    ):
        values = {joint: getattr(found[joint], field) for joint in spec.joint_order}
        assert values == robots.of(spec, calf=calf, other=other)
    assert robots.of(spec, calf=0.2, other=0.25) == loaded.QUAD_4_ACTION_SCALE


def test_mjlab_config_of_wheels(load, modules, robots):
    spec = robots.wheeled()
    loaded = load("mjlab", spec, modules)
    wheels, others = robots.wheels_of(spec)
    by_kind = {type(a).__name__: a for a in loaded.QUAD_4_ARTICULATION.actuators}
    rolling = by_kind.pop("BuiltinVelocityActuatorCfg")
    assert set(rolling.target_names_expr) == set(wheels)
    assert (rolling.damping, rolling.effort_limit, rolling.armature) == (0.75, 45.43, 0.04)
    (held,) = by_kind.values()
    assert set(held.target_names_expr) == set(others)
    assert dict.fromkeys(others, 0.25) == loaded.QUAD_4_ACTION_SCALE
    assert dict.fromkeys(wheels, 5.0) == loaded.QUAD_4_SPEED_SCALE
    text = Path(loaded.__file__).read_text()
    assert "# For JointVelocityActionCfg.scale.\n# [rad/s or m/s]; suggested: a share\n" in text
    assert "actuator_names=tuple(QUAD_4_SPEED_SCALE)" in loaded.__doc__
    plain = load("mjlab", robots.quadruped(), modules)
    assert "SPEED_SCALE" not in Path(plain.__file__).read_text()


def test_mjlab_config_with_only_wheels(load, modules, robots):
    spec = robots.plain(("left", "right"), stiffness={".*": 0.0})
    loaded = load("mjlab", spec, modules)
    kinds = {type(actuator).__name__ for actuator in loaded.ARM_ARTICULATION.actuators}
    assert kinds == {"BuiltinVelocityActuatorCfg"}
    assert loaded.ARM_SPEED_SCALE == {"left": 0.25, "right": 0.25}
    assert not hasattr(loaded, "ARM_ACTION_SCALE")


@pytest.mark.parametrize("more", ["", '<actuatorfrc actuator="FL_calf"/>'])
def test_mjlab_get_spec_removes_actuators(load, modules, robots, tmp_path, bundled_xml, more):
    text = bundled_xml.read_text().replace("</sensor>", more + "</sensor>")
    (tmp_path / "robot.xml").write_text(text)
    loaded = load("mjlab", robots.quadruped(), modules)
    with quiet_mujoco():
        before = mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml"))
        made = loaded.get_spec().compile()
    assert (before.nu, before.nkey) == (12, 1)
    assert (made.nu, made.nkey) == (0, 0)
    assert made.nsensor == before.nsensor - bool(more)


def test_mjlab_config_of_arm_without_limits(load, modules, robots):
    spec = robots.plain(("joint1", "joint10", "robot/wrist"), effort={}, armature={})
    loaded = load("mjlab", spec, modules)
    actuators = loaded.ARM_ARTICULATION.actuators
    assert [a.target_names_expr for a in actuators] == [("joint1$",), ("joint10",), ("wrist",)]
    assert all(a.effort_limit is None and a.armature is None for a in actuators)
    assert loaded.ARM_INIT_STATE.joint_pos == {"joint1$": 0.1, "joint10": 0.1, "wrist": 0.1}


def test_mjlab_config_without_joints(load, modules, robots):
    loaded = load("mjlab", robots.plain(()), modules)
    assert loaded.get_robot_cfg().articulation.actuators == ()


@pytest.mark.parametrize("which", ["quadruped", "wheeled"])
def test_mjlab_config_in_mjlab(robots, tmp_path, bundled_xml, which):
    """Set TERRAINKIT_MJLAB_PYTHON to a Python interpreter with mjlab."""
    python = os.environ.get("TERRAINKIT_MJLAB_PYTHON")
    if not python:
        pytest.skip("TERRAINKIT_MJLAB_PYTHON is not set to a Python interpreter with mjlab")
    shutil.copy(bundled_xml, tmp_path / "robot.xml")
    text = config_text("mjlab", getattr(robots, which)(), bodies=robots.bodies)
    (tmp_path / "mjlab_config.py").write_text(text)
    command = [python, PROBE, tmp_path, which]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
