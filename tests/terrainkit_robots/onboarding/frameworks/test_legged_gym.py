"""Tests of the configurations for legged_gym and LeggedGym-Ex, with stub modules."""

import ast
import sys
import tomllib
from collections import defaultdict
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from terrainkit.errors import ExportError
from terrainkit_robots.onboarding.frameworks.config_robot import ConfigRobot
from terrainkit_robots.onboarding.frameworks.frameworks import config_files

FIELDS = tomllib.loads(Path(__file__).with_name("legged_gym_fields.toml").read_text())
MORE = "leggedgym_ex"


def fields_of(*sections):
    """Return the fields of each class."""
    fields = defaultdict(list)
    for section in sections:
        for name, words in FIELDS[section].items():
            fields[name] += words.split()
    return fields


@pytest.fixture
def frameworks(stand_in):
    """Return a function that returns stubs of legged_gym, or with MORE of LeggedGym-Ex."""

    def parts(*sections):
        made = {}
        for path, names in fields_of(*sections).items():
            name, _, nested = path.partition(".")
            values = dict.fromkeys(names, 0.0)
            if nested:
                values = vars(made[name].__base__) | {nested: stand_in.part(nested, **values)}
                values = {key: each for key, each in values.items() if not key.startswith("__")}
            made[name] = stand_in.part(name, **values)
        return made

    def make(*more):
        config = stand_in.part("LeggedRobotCfg", **parts("legged_gym", *more))
        ppo = stand_in.part("LeggedRobotCfgPPO", seed=1, runner_class_name="", **parts("ppo"))
        base = "legged_gym.envs.base.legged_robot_config"
        return {
            "legged_gym": {"SIMULATOR": "genesis"},
            base: {"LeggedRobotCfg": config, "LeggedRobotCfgPPO": ppo},
        }

    return make


def gains_of(control, joint):
    """Return the gains that legged_gym assigns to a joint: the gains of the last matching key."""
    keys = [key for key in control.stiffness if key in joint]
    return control.stiffness[keys[-1]], control.damping[keys[-1]]


def words_of(loaded):
    """Return the text of a configuration without line ends and signs of comments."""
    return " ".join(Path(loaded.__file__).read_text().replace("#", "").split())


def bodies_of(asset, attribute, bodies):
    """Return the bodies that legged_gym finds, possibly with duplicates."""
    return [body for key in getattr(asset, attribute) for body in bodies if key in body]


def check_contacts(asset, spec, bodies):
    assert [body for body in bodies if asset.foot_name in body] == list(spec.feet)
    assert sorted(bodies_of(asset, "penalize_contacts_on", bodies)) == sorted(
        spec.penalized_contacts
    )
    assert bodies_of(asset, "terminate_after_contacts_on", bodies) == ["base"]
    assert asset.self_collisions == 1
    assert asset.collapse_fixed_joints
    assert not asset.flip_visual_attachments


def check_joints(config, robots, spec):
    assert config.init_state.default_joint_angles == robots.pose_of(spec)
    stiffness = robots.of(spec, calf=30.0, other=20.0)
    damping = robots.of(spec, calf=0.75, other=0.5)
    for joint in spec.joint_order:
        assert gains_of(config.control, joint) == (stiffness[joint], damping[joint])
    assert config.control.control_type == "P"
    assert config.control.action_scale == 0.25
    assert config.control.decimation == 4
    assert config.init_state.pos == [0.0, 0.0, 0.3]
    assert config.rewards.base_height_target == 0.287
    assert config.rewards.soft_dof_pos_limit == 0.75


RANGES = {f"{leg}_calf_joint": (-2.75, -0.75) for leg in ("FL", "FR", "RL", "RR")}


def test_legged_gym_config_of_quadruped(load, frameworks, robots, tmp_path):
    spec = robots.quadruped()
    loaded = load("legged_gym", spec, frameworks(), bodies=robots.bodies, limits=RANGES)
    config = loaded.Quad4RoughCfg
    check_joints(config, robots, spec)
    check_contacts(config.asset, spec, robots.bodies)
    assert config.env.num_observations == 235
    assert config.env.num_actions == 12
    assert config.asset.file.format(LEGGED_GYM_ROOT_DIR="/x") == str(tmp_path / "robot.urdf")
    assert config.asset.name == "quad_4"
    assert config.asset.armature == 0.04
    assert loaded.Quad4RoughCfgPPO.runner.experiment_name == "rough_quad_4"
    assert "_get_noise_scale_vec" not in loaded.__doc__


def test_leggedgym_ex_config_of_quadruped(load, frameworks, robots, tmp_path):
    spec = robots.quadruped(velocity={".*_calf_joint": 15.7})
    known = {"bodies": robots.bodies, "limits": RANGES, "foot_height": 0.022}
    loaded = load("leggedgym_ex", spec, frameworks(MORE), **known)
    config = loaded.Quad4Cfg
    check_joints(config, robots, spec)
    check_contacts(config.asset, spec, robots.bodies)
    assert config.env.num_observations == 9 + 3 * 12
    assert config.env.num_privileged_obs == 12 + 3 * 12
    assert (config.terrain.mesh_type, config.terrain.measure_heights) == ("plane", False)
    assert config.control.dt == config.control.decimation * 0.005
    assert Path(config.asset.file.format()) == tmp_path / "robot.urdf"
    assert Path(config.asset.xml_file.format()) == tmp_path / "robot.xml"
    assert config.asset.base_link_name == "base"
    assert config.asset.dof_names == list(spec.joint_order)
    assert config.asset.dof_armature == list(robots.of(spec, calf=0.04, other=0.01).values())
    speeds = robots.of(spec, calf=15.7, other=float("inf"))
    assert config.asset.dof_vel_limits == list(speeds.values())
    assert config.asset.links_to_keep == list(spec.feet)
    assert config.rewards.scales.tracking_lin_vel == 1.0
    assert config.rewards.foot_height_offset == 0.022
    assert config.commands.curriculum
    assert loaded.Quad4CfgPPO.runner.run_name == "genesis"
    # Genesis requires exactly one matching key for each joint.
    for joint in spec.joint_order:
        assert sum(key in joint for key in config.control.stiffness) == 1


def test_leggedgym_ex_has_classes_of_every_section(load, frameworks, robots):
    loaded = load("leggedgym_ex", robots.quadruped(), frameworks(MORE))
    sections = {name for name in vars(loaded.Quad4Cfg) if not name.startswith("__")}
    expected = fields_of("legged_gym", MORE)
    assert sections == {name for name in expected if "." not in name}
    assert {*fields_of("ppo"), "seed", "runner_class_name"} <= vars(loaded.Quad4CfgPPO).keys()
    scales = vars(loaded.Quad4Cfg.rewards.scales)
    assert {name for name in scales if not name.startswith("__")} == set(expected["rewards.scales"])


def test_leggedgym_ex_has_no_reward_for_missing_limits(load, frameworks, robots):
    """Genesis returns infinite limits, whose mean is NaN."""
    spec = robots.quadruped()
    limits = dict.fromkeys(spec.joint_order, (-1.0, 1.0))
    for missing, scale in ((), -1.0), (("FL_hip_joint",), 0.0):
        known = {name: limits[name] for name in spec.joint_order if name not in missing}
        loaded = load("leggedgym_ex", spec, frameworks(MORE), limits=known)
        assert loaded.Quad4Cfg.rewards.scales.dof_pos_limits == scale


def test_leggedgym_ex_files_are_a_package(robots):
    files = config_files("leggedgym_ex", ConfigRobot(spec=robots.quadruped(), bodies=robots.bodies))
    assert set(files) == {"quad_4_config.py", "quad_4.py", "__init__.py"}
    for text in files.values():
        ast.parse(text, feature_version=(3, 8))
    assert "from legged_gym.envs.quad_4.quad_4_config import (" in files["quad_4.py"]


class Walker:
    """The environment of LeggedGym-Ex with two robots that stand at a height of 0.4 m."""

    num_privileged_obs, add_noise, device = 235, True, "cpu"

    def __init__(self, cfg):
        self.cfg = cfg
        self._parse_cfg(cfg)
        self.commands, self.commands_scale = torch.zeros(2, 4), torch.ones(3)
        self.actions, self.noise_scale_vec = torch.zeros(2, 12), torch.ones(232)
        self.obs_scales = cfg.normalization.obs_scales
        triples = ("projected_gravity", "base_ang_vel", "base_lin_vel", "base_pos")
        joints = ("dof_pos", "default_dof_pos", "dof_vel")
        self.simulator = SimpleNamespace(
            **{name: torch.full((2, 3), 0.4) for name in triples},
            **{name: torch.zeros(2, 12) for name in joints},
            measured_heights=torch.full((2, 187), -0.3),
            _robot=SimpleNamespace(set_dofs_armature=self.set_armature),
            _dof_indices=range(6, 18),
        )
        self._init_buffers()

    def set_armature(self, values, joints):
        self.armature = dict(zip(joints, values.tolist(), strict=True))

    def _parse_cfg(self, cfg):
        """Do nothing."""

    def _init_buffers(self):
        """Do nothing."""


def test_leggedgym_ex_trains_on_a_map(load, frameworks, robots, monkeypatch):
    """The task replaces the terrain, and its critic observes without noise."""
    spec, terrain = robots.quadruped(), type("Terrain", (), {})
    registry = SimpleNamespace(task_classes={}, register=lambda *_: None)
    content = frameworks(MORE) | {
        "legged_gym.envs.base.legged_robot": {"LeggedRobot": Walker},
        "legged_gym.envs.quad_4.terrain": {"Terrain": terrain},
        "legged_gym.simulator.genesis_simulator": {"Terrain": None},
        "legged_gym.utils.task_registry": {"task_registry": registry},
    }
    loaded = load("leggedgym_ex", spec, content, has_map=True)
    config = loaded.Quad4Cfg
    assert (config.env.num_observations, config.env.num_privileged_obs) == (45 + 187, 48 + 187)
    assert (config.terrain.mesh_type, config.terrain.curriculum) == ("heightfield", True)
    assert config.terrain.measure_heights
    scales = config.rewards.scales
    assert (scales.base_height, scales.orientation, scales.foot_clearance) == (0, 0, 0)
    monkeypatch.setitem(sys.modules, "legged_gym.envs.quad_4.quad_4_config", loaded)
    robot = ConfigRobot(spec=spec, has_map=True)
    exec(config_files("leggedgym_ex", robot)["quad_4.py"], vars(loaded))
    env = loaded.Quad4(config)
    assert sys.modules["legged_gym.simulator.genesis_simulator"].Terrain is terrain
    assert list(env.armature.values()) == pytest.approx(config.asset.dof_armature)
    env.compute_observations()
    assert env.obs_buf.shape == (2, 232)
    # (0.4 - 0.5 + 0.3) * 5 for each height; then the velocity of the base.
    np.testing.assert_allclose(env.privileged_obs_buf[:, 45:232], 1.0, rtol=1e-5)
    np.testing.assert_allclose(env.privileged_obs_buf[:, 232:], 0.4, rtol=1e-5)


def test_leggedgym_ex_rejects_name_of_its_own_robot(robots):
    with pytest.raises(ExportError, match=r"got 'go2', a name in LeggedGym-Ex; .* --name my_go2"):
        config_files("leggedgym_ex", ConfigRobot(spec=robots.quadruped(name="Go2")))


def test_legged_gym_config_uses_largest_armature(load, frameworks, robots):
    """With the median armature of 0, a light ankle would be unstable."""
    armature = {".*_(hip|thigh)_joint": 0.0, ".*_calf_joint": 0.01}
    spec = robots.quadruped(armature=armature, urdf="{my}.urdf")
    loaded = load("legged_gym", spec, frameworks())
    assert loaded.Quad4RoughCfg.asset.armature == 0.01
    assert loaded.Quad4RoughCfg.asset.file.format().endswith("/{my}.urdf")
    text = words_of(loaded)
    assert "One value for all joints, the largest of 0.0 to 0.01." in text


class LeggedRobot:
    """The control of legged_gym for two robots with a position of 0.2 rad and 3 rad/s."""

    device = "cpu"

    def __init__(self, names, gains):
        self.dof_names, self.simulator = names, self
        self.dof_pos, self.default_dof_pos = torch.full((2, 12), 0.2), torch.zeros(1, 12)
        self.dof_vel, self.torque_limits = torch.full((2, 12), 3.0), torch.full((12,), 4.0)
        self.p_gains, self.d_gains = torch.tensor(gains).T
        self._kd_scale, self._d_gains = torch.ones(2, 1), self.d_gains
        self.cfg = SimpleNamespace(asset=SimpleNamespace(dof_names=names))
        self.obs_scales = SimpleNamespace(dof_pos=0.5)

    def _compute_torques(self, actions):
        torques = self.p_gains * (0.25 * actions - self.dof_pos) - self.d_gains * self.dof_vel
        return torch.clip(torques, -4.0, 4.0)

    def compute_observations(self):
        self.obs_buf = self.dof_pos - self.default_dof_pos


@pytest.mark.parametrize("framework", ["legged_gym", "leggedgym_ex"])
def test_legged_configs_control_the_speed_of_wheels(
    load, frameworks, robots, framework, monkeypatch
):
    spec = robots.wheeled(joint_order=robots.quadruped().joint_order)
    registry = SimpleNamespace(task_classes={}, register=lambda *_: None)
    task = {
        "legged_gym.envs.base.legged_robot": {"LeggedRobot": LeggedRobot},
        "legged_gym.utils.task_registry": {"task_registry": registry},
    }
    loaded = load(framework, spec, frameworks(MORE) | task)
    config = loaded.Quad4RoughCfg if framework == "legged_gym" else loaded.Quad4Cfg
    assert config.control.action_scale == 0.25
    gains = [gains_of(config.control, joint) for joint in spec.joint_order]
    if framework == "leggedgym_ex":
        monkeypatch.setitem(sys.modules, "legged_gym.envs.quad_4.quad_4_config", loaded)
        exec(config_files(framework, ConfigRobot(spec=spec))["quad_4.py"], vars(loaded))
    env = loaded.Quad4(list(spec.joint_order), gains)
    torques = env.simulator._compute_torques(torch.full((2, 12), 1.0))
    # 0.75 * (5 * 1 - 3) for a wheel; 20 * (0.25 * 1 - 0.2) - 0.5 * 3 for a joint of a leg.
    expected = [1.5 if "calf" in joint else -0.5 for joint in spec.joint_order]
    np.testing.assert_allclose(torques, [expected] * 2, atol=1e-6)
    if framework == "legged_gym":
        env.compute_observations()
        seen = env.obs_buf
    else:
        seen = 2 * env.dof_pos_scale * env.dof_pos
    expected = [0.0 if "calf" in joint else 0.2 for joint in spec.joint_order]
    np.testing.assert_allclose(seen, [expected] * 2, atol=1e-6)


@pytest.mark.parametrize("framework", ["legged_gym", "leggedgym_ex"])
def test_legged_configs_without_wheels_have_no_speeds(load, frameworks, robots, framework):
    loaded = load(framework, robots.quadruped(), frameworks(MORE))
    assert "SPEED_SCALE" not in Path(loaded.__file__).read_text()


def test_legged_configs_hold_joints_without_action(load, frameworks, robots):
    scales = {".*_(hip|thigh)_joint": 0.25, ".*_calf_joint": 0.0}
    loaded = load("legged_gym", robots.quadruped(action_scale=scales), frameworks())
    assert loaded.Quad4RoughCfg.control.action_scale == 0.25
    assert "to 0, to hold the default pose: FL_calf_joint, FR_calf_joint, " in words_of(loaded)


def test_stub_modules_reject_unknown_fields(frameworks, load, robots):
    """The stubs of legged_gym reject the additional fields of LeggedGym-Ex."""
    with pytest.raises(AttributeError, match="has no"):
        load("leggedgym_ex", robots.quadruped(), frameworks())


def test_legged_gym_config_warns_about_noise_vector(load, frameworks, robots):
    spec = robots.quadruped()
    names = ("stiffness", "damping", "action_scale", "default_pose")
    tables = {name: {".*": 1.0} for name in names} | {"soft_limits": {}}
    fewer = robots.quadruped(joint_order=spec.joint_order[:6], feet=spec.feet[:2], **tables)
    loaded = load("legged_gym", fewer, frameworks())
    assert loaded.Quad4RoughCfg.env.num_observations == 12 + 18 + 187
    assert "_get_noise_scale_vec supports 12 joints" in " ".join(loaded.__doc__.split())


@pytest.mark.parametrize("framework", ["legged_gym", "leggedgym_ex"])
def test_legged_configs_of_ambiguous_joint_names(load, frameworks, robots, framework):
    joints = tuple(f"joint{number}" for number in (10, 1, 2, 11))
    gains = dict(zip(joints, (4.0, 1.0, 2.0, 1.0), strict=True))
    tables = dict.fromkeys(("stiffness", "damping", "action_scale", "default_pose"), gains)
    spec = robots.quadruped(
        joint_order=joints, effort={}, velocity={}, armature={}, soft_limits={}, **tables
    )
    loaded = load(framework, spec, frameworks(MORE))
    config = loaded.Quad4RoughCfg if framework == "legged_gym" else loaded.Quad4Cfg
    for joint in joints:
        assert gains_of(config.control, joint) == (gains[joint], gains[joint])
    text = words_of(loaded)
    assert "joint10 contains joint1: " in text
    assert config.control.action_scale == 1.5


def test_leggedgym_ex_config_keeps_hostile_names(load, frameworks, robots):
    spec = robots.hostile()
    loaded = load("leggedgym_ex", spec, frameworks(MORE))
    (config,) = (c for n, c in vars(loaded).items() if n.endswith("Cfg") and n != "LeggedRobotCfg")
    assert config.asset.dof_names == list(spec.joint_order)
    assert set(config.init_state.default_joint_angles) == set(spec.joint_order)
    assert config.asset.base_link_name == spec.base
    assert config.asset.file.format().endswith(spec.urdf)
