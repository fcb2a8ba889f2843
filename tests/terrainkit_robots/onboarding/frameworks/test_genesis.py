"""Tests of the configuration for Genesis, with stubs and with Genesis if available."""

import os
import shutil
import subprocess
from pathlib import Path
from types import SimpleNamespace

import pytest

from terrainkit_robots.onboarding.frameworks.config_robot import ConfigRobot
from terrainkit_robots.onboarding.frameworks.genesis import config_text

PROBE = Path(__file__).with_name("genesis_probe.py")


class Robot:
    """Stub of a Genesis entity with reversed joint order, which records all calls."""

    def __init__(self, joints):
        self.places = {joint: 6 + place for place, joint in enumerate(reversed(joints))}
        self.calls = {}

    def get_joint(self, name):
        return SimpleNamespace(dofs_idx_local=[self.places[name]])

    def _record(self, what, values, dofs_idx_local):
        joints = {place: joint for joint, place in self.places.items()}
        by_joint = {joints[i]: v for i, v in zip(dofs_idx_local, values, strict=True)}
        assert self.calls.setdefault(what, by_joint) is by_joint

    def set_dofs_kp(self, kp, dofs_idx_local):
        self._record("kp", kp, dofs_idx_local)

    def set_dofs_kv(self, kv, dofs_idx_local):
        self._record("kv", kv, dofs_idx_local)

    def set_dofs_force_range(self, lower, upper, dofs_idx_local):
        assert lower == [-value for value in upper]
        self._record("force", upper, dofs_idx_local)

    def set_dofs_armature(self, armature, dofs_idx_local):
        self._record("armature", armature, dofs_idx_local)

    def set_dofs_position(self, position, dofs_idx_local):
        self._record("position", position, dofs_idx_local)

    def control_dofs_position(self, position, dofs_idx_local):
        self._record("target", position, dofs_idx_local)

    def control_dofs_velocity(self, velocity, dofs_idx_local):
        self._record("speed", velocity, dofs_idx_local)


class Scene:
    """Stub of a Genesis scene."""

    def __init__(self, robot):
        self.robot, self.morph, self.n_envs = robot, None, None

    def add_entity(self, morph):
        assert self.n_envs is None
        self.morph = morph
        return self.robot

    def build(self, n_envs):
        self.n_envs = n_envs


@pytest.fixture
def modules(stand_in):
    urdf = stand_in.refusing(
        "URDF",
        "file",
        pos=(0.0, 0.0, 0.0),
        fixed=False,
        merge_fixed_links=True,
        links_to_keep=(),
        default_armature=0.1,
    )
    return {"genesis": stand_in.module("genesis", morphs=SimpleNamespace(URDF=urdf))}


def test_genesis_config_of_quadruped(load, modules, robots, tmp_path):
    spec = robots.quadruped()
    loaded = load("genesis", spec, modules, bodies=robots.bodies)
    scene = Scene(Robot(spec.joint_order))
    robot = loaded.build(scene, n_envs=8)
    assert scene.n_envs == 8
    assert scene.morph.file == str(tmp_path / "robot.urdf")
    assert scene.morph.pos == (0.0, 0.0, 0.3)
    assert scene.morph.fixed is False
    assert scene.morph.default_armature is None
    assert set(spec.feet) <= set(scene.morph.links_to_keep)
    pose = {
        joint: -1.8 if "calf" in joint else 0.9 if "thigh" in joint else 0.0
        for joint in spec.joint_order
    }
    assert robot.calls == {
        "kp": robots.of(spec, calf=30.0, other=20.0),
        "kv": robots.of(spec, calf=0.75, other=0.5),
        "force": robots.of(spec, calf=45.43, other=23.7),
        "armature": robots.of(spec, calf=0.04, other=0.01),
        "position": pose,
        "target": pose,
    }
    assert loaded.dofs(robot) == list(range(17, 5, -1))
    assert robots.of(spec, calf=0.2, other=0.25) == loaded.ACTION_SCALE
    assert tuple(loaded.FEET) == spec.feet


def test_genesis_config_of_wheels(load, modules, robots):
    spec = robots.wheeled()
    loaded = load("genesis", spec, modules)
    robot = loaded.build(Scene(Robot(spec.joint_order)))
    wheels, others = robots.wheels_of(spec)
    assert robot.calls["speed"] == dict.fromkeys(wheels, 0.0)
    assert set(robot.calls["target"]) == set(others)
    assert set(robot.calls["position"]) == set(spec.joint_order)
    assert robot.calls["kp"] == robots.of(spec, calf=0.0, other=20.0)
    assert dict.fromkeys(others, 0.25) == loaded.ACTION_SCALE
    assert dict.fromkeys(wheels, 5.0) == loaded.SPEED_SCALE
    text = Path(loaded.__file__).read_text()
    assert "[rad/s or m/s]; suggested: a share\nSPEED_SCALE = {" in text


def test_genesis_config_with_only_wheels(load, modules, robots):
    spec = robots.plain(("left", "right"), stiffness={".*": 0.0})
    robot = load("genesis", spec, modules).build(Scene(Robot(spec.joint_order)))
    assert robot.calls["speed"] == {"left": 0.0, "right": 0.0}
    assert "target" not in robot.calls


def test_genesis_config_with_missing_limits(load, modules, robots):
    spec = robots.plain(("a", "b"), effort={"b": 3.0}, armature={})
    robot = load("genesis", spec, modules).build(Scene(Robot(spec.joint_order)))
    assert robot.calls["force"] == {"b": 3.0}
    assert "armature" not in robot.calls


def test_genesis_config_without_joints(load, modules, robots):
    robot = load("genesis", robots.plain(()), modules).build(Scene(Robot(())))
    assert robot.calls == {}


def test_genesis_config_keeps_hostile_names(load, modules, robots):
    spec = robots.hostile()
    loaded = load("genesis", spec, modules)
    scene = Scene(Robot(spec.joint_order))
    assert loaded.build(scene).calls["kp"] == spec.stiffness
    assert scene.morph.file.endswith(spec.urdf)


@pytest.mark.parametrize("which", ["quadruped", "wheeled"])
def test_genesis_config_in_genesis(robots, tmp_path, bundled_xml, which):
    """Set TERRAINKIT_GENESIS_PYTHON to a Python interpreter with genesis-world."""
    python = os.environ.get("TERRAINKIT_GENESIS_PYTHON")
    if not python:
        pytest.skip(
            "TERRAINKIT_GENESIS_PYTHON is not set to a Python interpreter with genesis-world"
        )
    shutil.copy(bundled_xml.with_suffix(".urdf"), tmp_path / "robot.urdf")
    text = config_text(ConfigRobot(spec=getattr(robots, which)(), bodies=robots.bodies))
    (tmp_path / "genesis_config.py").write_text(text)
    command = [python, PROBE, tmp_path, which]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
