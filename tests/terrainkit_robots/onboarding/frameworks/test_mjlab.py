"""Tests of the configuration for mjlab, with stub modules and with mjlab if available."""

import os
import re
import shutil
import subprocess
from dataclasses import make_dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import pytest

from terrainkit import MapConfig, generate
from terrainkit_robots.description import bundled
from terrainkit_robots.onboarding.frameworks.config_robot import ConfigRobot
from terrainkit_robots.onboarding.frameworks.mjlab import config_text
from terrainkit_robots.onboarding.onboard_options import OnboardOptions
from terrainkit_robots.onboarding.pipeline import onboard
from terrainkit_robots.quiet_mujoco import quiet_mujoco

PROBE = Path(__file__).with_name("mjlab_probe.py")

SENSOR_FIELDS = ("primary", "secondary", "reduce", "track_air_time", "history_length")


def velocity_env_cfg():
    """Return the parts of mjlab's velocity task that a configuration changes."""

    def term(name):
        return SimpleNamespace(params={name: SimpleNamespace()})

    def group():
        names = ("base_lin_vel", "base_ang_vel", "height_scan")
        terms = {name: SimpleNamespace(params={}) for name in names}
        return SimpleNamespace(terms=terms, enable_corruption=True)

    rewards = ("pose", "upright", "body_ang_vel")
    rewards += ("foot_clearance", "foot_slip", "foot_swing_height")
    return SimpleNamespace(
        sim=SimpleNamespace(mujoco=SimpleNamespace()),
        viewer=SimpleNamespace(),
        scene=SimpleNamespace(
            terrain=SimpleNamespace(terrain_generator=SimpleNamespace()),
            sensors=(
                SimpleNamespace(name="terrain_scan", frame=SimpleNamespace()),
                SimpleNamespace(name="foot_height_scan"),
            ),
        ),
        decimation=4,
        observations={"actor": group(), "critic": group()},
        actions={"joint_pos": SimpleNamespace(actuator_names=(".*",), scale=0.5)},
        events={"foot_friction": term("asset_cfg"), "base_com": term("asset_cfg"), "push_robot": 0},
        rewards={name: term("asset_cfg") for name in rewards},
        terminations={"fell_over": 0, "out_of_terrain_bounds": 0},
        curriculum={"terrain_levels": 0, "command_vel": 0},
    )


@pytest.fixture
def registered():
    """Return the registered tasks by name."""
    return {}


@pytest.fixture
def modules(registered):
    sensor = make_dataclass("ContactSensorCfg", ["name", *((f, Any, None) for f in SENSOR_FIELDS)])
    runner = make_dataclass("RslRlOnPolicyRunnerCfg", [("experiment_name", str, "go1_velocity")])
    ring = SimpleNamespace(single_ring=lambda **options: options)
    return {
        "mjlab.sensor": {
            "ContactSensorCfg": sensor,
            "ObjRef": lambda *words: words,
            "RingPatternCfg": ring,
        },
        "mjlab.tasks.registry": {
            "register_mjlab_task": lambda task_id, **parts: registered.update({task_id: parts})
        },
        "mjlab.tasks.velocity.config.go1.rl_cfg": {"unitree_go1_ppo_runner_cfg": runner},
        "mjlab.tasks.velocity.velocity_env_cfg": {"make_velocity_env_cfg": velocity_env_cfg},
    }


def by_target(robots, actuators, names):
    return robots.resolved({p: each for each in actuators for p in each.target_names_expr}, names)


def test_mjlab_config_of_quadruped(load, modules, robots):
    spec = robots.quadruped()
    loaded = load("mjlab", spec, modules)
    entity = loaded.get_robot_cfg()
    assert entity is not loaded.get_robot_cfg()
    assert entity.init_state.pos == (0.0, 0.0, 0.3)
    assert robots.resolved(entity.init_state.joint_pos, spec.joint_order)["RR_calf_joint"] == -1.8
    assert entity.articulation.soft_joint_pos_limit_factor == 0.9
    assert len(entity.articulation.actuators) == 2
    found = by_target(robots, entity.articulation.actuators, spec.joint_order)
    for field, calf, other in (
        ("stiffness", 30.0, 20.0),
        ("damping", 0.75, 0.5),
        ("effort_limit", 45.43, 23.7),
        ("armature", 0.04, 0.01),
    ):
        values = {joint: getattr(found[joint], field) for joint in spec.joint_order}
        assert values == robots.of(spec, calf=calf, other=other)
    assert not hasattr(loaded, "SPEED_SCALE")
    scales = robots.resolved(loaded.ACTION_SCALE, spec.joint_order)
    assert scales == robots.of(spec, calf=0.2, other=0.25)


def test_mjlab_tasks_of_quadruped(load, modules, robots, registered):
    spec = robots.quadruped(leg_length=0.2)
    loaded = load("mjlab", spec, modules, bodies=robots.bodies, roles={"FL_hip_joint": "roll"})
    loaded.register_tasks()
    assert list(registered) == ["Mjlab-Velocity-Flat-Quad4", "Mjlab-Velocity-Rough-Quad4"]
    flat, rough = (task["env_cfg"] for task in registered.values())
    assert flat.actions["joint_pos"].actuator_names == (".*",)
    sensors = {sensor.name: sensor for sensor in rough.scene.sensors}
    assert sensors["terrain_scan"].frame.name == "base"
    assert sensors["foot_height_scan"].frame == tuple(("site", n, "robot") for n in spec.feet)
    assert sensors["feet_ground_contact"].primary.pattern == spec.feet
    assert sensors["undesired_contact"].primary.pattern == (".*_thigh", ".*_calf")
    assert sensors["illegal_contact"].primary.pattern == ("base",)
    assert sensors["self_collision"].primary.pattern == "base"
    geoms = rough.events["foot_friction"].params["asset_cfg"].geom_names
    assert all(re.fullmatch(geoms[0], f"FL_foot_collision{end}") for end in ("", "1", "12"))
    assert not re.fullmatch(geoms[0], "FL_foot_collision_mesh")
    pose = rough.rewards["pose"].params
    for name, roll, other in (("std_walking", 0.15, 0.15), ("std_running", 0.2, 0.3)):
        std = robots.resolved(pose[name], spec.joint_order)
        assert std == dict.fromkeys(spec.joint_order, other) | {"FL_hip_joint": roll}
    assert rough.rewards["foot_clearance"].params["target_height"] == 0.05
    assert rough.terminations["illegal_contact"].params == {"sensor_name": "illegal_contact"}
    assert flat.scene.terrain.terrain_type == "plane"
    assert "terrain_scan" not in [sensor.name for sensor in flat.scene.sensors]
    assert "height_scan" not in flat.observations["actor"].terms
    assert flat.curriculum == {"command_vel": 0}
    assert not registered["Mjlab-Velocity-Flat-Quad4"]["play_env_cfg"].curriculum
    assert registered["Mjlab-Velocity-Flat-Quad4"]["rl_cfg"].experiment_name == "quad_4"


@pytest.mark.parametrize("format_name", ["urdf", "xml"])
def test_mjlab_names_are_in_robot_xml(onboarded, load, modules, format_name):
    """The names of bodies, sites, geoms and sensors exist in the written file."""
    path = bundled.urdf_path("biped").with_suffix(f".{format_name}")
    result = onboarded(path)
    with quiet_mujoco():
        model = mujoco.MjModel.from_xml_path(str(result.folder / "robot.xml"))
    sites = [model.site(index).name for index in range(model.nsite)]
    loaded = load("mjlab", result.robot.spec, modules, sites=sites)
    for actuator in loaded.ARTICULATION.actuators:
        for pattern in actuator.target_names_expr:
            assert not any(re.fullmatch(pattern, site) for site in sites)
    body = [model.body(index).name for index in range(model.nbody)]
    geoms = [model.geom(index).name for index in range(model.ngeom)]
    sensors = [model.sensor(index).name for index in range(model.nsensor)]
    assert loaded.BASE in body
    for foot, pattern in zip(loaded.FEET, loaded.FOOT_GEOMS, strict=True):
        assert foot in body
        assert model.site(foot).bodyid[0] == model.body(foot).id
        assert [geom for geom in geoms if re.fullmatch(pattern, geom)]
    for patterns in (loaded.PENALIZED, loaded.TERMINATION):
        assert all(any(re.fullmatch(p, name) for name in body) for p in patterns)
    for terms in loaded.velocity_env_cfg(rough=False).observations.values():
        for name in ("base_lin_vel", "base_ang_vel"):
            assert terms.terms[name].params["sensor_name"].removeprefix("robot/") in sensors


def test_mjlab_config_of_wheels(load, modules, robots):
    spec = robots.wheeled()
    loaded = load("mjlab", spec, modules)
    wheels, others = robots.wheels_of(spec)
    by_kind = {type(a).__name__: a for a in loaded.ARTICULATION.actuators}
    rolling = by_kind.pop("BuiltinVelocityActuatorCfg")
    assert set(by_target(robots, [rolling], spec.joint_order)) == set(wheels)
    assert (rolling.damping, rolling.effort_limit, rolling.armature) == (0.75, 45.43, 0.04)
    (held,) = by_kind.values()
    assert set(by_target(robots, [held], spec.joint_order)) == set(others)
    assert robots.resolved(loaded.ACTION_SCALE, spec.joint_order) == dict.fromkeys(others, 0.25)
    assert robots.resolved(loaded.SPEED_SCALE, spec.joint_order) == dict.fromkeys(wheels, 5.0)
    text = Path(loaded.__file__).read_text()
    assert "# For JointVelocityActionCfg.scale.\n# [rad/s or m/s]; suggested: a share\n" in text
    actions = loaded.velocity_env_cfg(rough=False).actions
    assert actions["joint_pos"].actuator_names == (".*_hip_joint", ".*_thigh_joint")
    assert actions["joint_vel"].actuator_names == (".*_calf_joint",)


def test_mjlab_config_with_only_wheels(load, modules, robots):
    spec = robots.plain(("left", "right"), stiffness={".*": 0.0})
    loaded = load("mjlab", spec, modules)
    kinds = {type(actuator).__name__ for actuator in loaded.ARTICULATION.actuators}
    assert kinds == {"BuiltinVelocityActuatorCfg"}
    assert loaded.SPEED_SCALE == {".*": 0.25}
    assert not hasattr(loaded, "ACTION_SCALE")
    assert "actuator_names=tuple(SPEED_SCALE)" in loaded.__doc__
    assert not hasattr(loaded, "register_tasks")  # no legs


@pytest.mark.parametrize("more", ["", '<actuatorfrc actuator="FL_calf"/>'])
def test_mjlab_get_spec_removes_actuators(load, modules, robots, tmp_path, bundled_xml, more):
    text = bundled_xml.read_text().replace("</sensor>", more + "</sensor>")
    text = text.replace("<worldbody>", '<option timestep="0.004"/><worldbody>')
    (tmp_path / "robot.xml").write_text(text)
    loaded = load("mjlab", robots.quadruped(), modules)
    with quiet_mujoco():
        before = mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml"))
        made = loaded.get_spec().compile()
    assert (before.nu, before.nkey) == (12, 1)
    assert (made.nu, made.nkey) == (0, 0)
    assert (before.opt.timestep, made.opt.timestep) == (0.004, 0.002)
    assert made.nsensor == before.nsensor - bool(more)


def test_mjlab_config_of_arm_without_limits(load, modules, robots):
    spec = robots.plain(("joint1", "joint10", "robot/wrist"), effort={}, armature={})
    loaded = load("mjlab", spec, modules)
    actuators = loaded.ARTICULATION.actuators
    assert [a.target_names_expr for a in actuators] == [("joint1$",), ("joint10",), ("wrist",)]
    assert not any(vars(a).keys() & {"effort_limit", "armature"} for a in actuators)
    assert loaded.INIT_STATE.joint_pos == {"joint1$": 0.1, "joint10": 0.1, "wrist": 0.1}
    loaded = load("mjlab", robots.plain(()), modules)
    assert loaded.get_robot_cfg().articulation.actuators == ()


@pytest.fixture
def mjlab_python():
    """Return the Python interpreter in TERRAINKIT_MJLAB_PYTHON, which has mjlab 1.6."""
    python = os.environ.get("TERRAINKIT_MJLAB_PYTHON")
    if not python:
        pytest.skip("TERRAINKIT_MJLAB_PYTHON is not set to a Python interpreter with mjlab")
    return python


@pytest.mark.parametrize("which", ["quadruped", "wheeled"])
def test_mjlab_config_in_mjlab(robots, tmp_path, bundled_xml, mjlab_python, which):
    shutil.copy(bundled_xml, tmp_path / "robot.xml")
    text = config_text(ConfigRobot(spec=getattr(robots, which)(), bodies=robots.bodies))
    (tmp_path / "mjlab_config.py").write_text(text)
    command = [mjlab_python, PROBE, tmp_path, which]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("terrain", ["Flat", "Rough", "map"])
@pytest.mark.parametrize("name", ["quadruped", "biped"])
def test_mjlab_trains_onboarded_robot(tmp_path, mjlab_python, name, terrain):
    if is_map := terrain == "map":
        generate(MapConfig(rows=2, cols=4, preset="stairs")).save(tmp_path / "map.npz")
        terrain = "Rough"
    options = OnboardOptions(frameworks=("mjlab",), render_images=False)
    onboard(bundled.urdf_path(name), tmp_path / "robot", options)
    task = f"Mjlab-Velocity-{terrain}-{name.capitalize()}"
    words = [task, "--env.scene.num-envs", "4", "--agent.max-iterations", "2", "--gpu-ids", "None"]
    words += ["--agent.logger", "tensorboard", *["--map", "map.npz"] * is_map]
    done = subprocess.run(
        [mjlab_python, "robot/mjlab_config.py", *words],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env=os.environ | {"WANDB_MODE": "off"},
    )
    assert done.returncode == 0, done.stderr
    assert "Learning iteration 1/2" in done.stdout
    assert ("terrain_progress" in done.stdout) == is_map
    assert "site(s)" not in done.stderr
    assert not (tmp_path / "MUJOCO_LOG.TXT").exists()
