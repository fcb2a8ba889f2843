"""Tests of the configuration for Isaac Lab, with stub modules."""

from pathlib import Path
from types import SimpleNamespace

import pytest


@pytest.fixture(params=["core.velocity", "manager_based.locomotion.velocity"], ids=["v3", "v2"])
def modules(stand_in, request):
    """Return the content of Isaac Lab 3 or 2; their modules of the velocity task differ."""
    articulation = stand_in.recorder("ArticulationCfg")
    articulation.replace = lambda self, **more: articulation(**(vars(self) | more))
    mdp = SimpleNamespace(JointVelocityActionCfg=stand_in.recorder("JointVelocityActionCfg"))
    task = SimpleNamespace(LocomotionVelocityRoughEnvCfg=velocity_task(stand_in), mdp=mdp)
    return {
        "isaaclab.assets": {"ArticulationCfg": articulation},
        "isaaclab.utils": {"configclass": lambda made: made},
        "isaaclab_tasks.core": {} if request.param.startswith("core") else None,
        f"isaaclab_tasks.{request.param}": {"velocity_env_cfg": task},
    }


def velocity_task(stand_in):
    """Return a stub of the class of Isaac Lab's velocity task."""
    strict = stand_in.Strict

    def term(key):
        return strict(params={key: strict(body_names="base")})

    class Task(strict):
        """The base class; `__post_init__` runs when the task is made."""

        def __init__(self):
            super().__init__(
                scene=strict(
                    robot=None,
                    height_scanner=strict(prim_path=""),
                    contact_forces=strict(prim_path=""),
                ),
                actions=SimpleNamespace(joint_pos=strict(scale=0.5, joint_names=[".*"])),
                events=strict(
                    add_base_mass=term("asset_cfg"),
                    base_external_force_torque=term("asset_cfg"),
                    reset_robot_joints=strict(params={"position_range": (0.5, 1.5)}),
                ),
                rewards=strict(
                    feet_air_time=term("sensor_cfg"), undesired_contacts=term("sensor_cfg")
                ),
                terminations=strict(base_contact=term("sensor_cfg")),
            )
            self.__post_init__()

        def __post_init__(self):
            pass

    return Task


def driven_by(robots, actuators, names):
    """Return the actuator of each joint."""
    return robots.resolved({p: each for each in actuators for p in each.joint_names_expr}, names)


def test_isaaclab_config_of_quadruped(load, modules, robots, tmp_path):
    spec = robots.quadruped()
    config = load("isaaclab", spec, modules, bodies=robots.bodies).QUAD_4_CFG
    names = (*spec.joint_order, "FL_hip_joint_2", "tail")  # must not be matched
    assert config.spawn.asset_path == str(tmp_path / "robot.urdf")
    assert config.spawn.fix_base is False
    assert config.spawn.activate_contact_sensors
    assert config.init_state.pos == (0.0, 0.0, 0.3)
    assert robots.resolved(config.init_state.joint_pos, names) == robots.pose_of(spec)
    # A DC motor has one saturation effort, so the calves have their own motor.
    assert {n: type(a).__name__ for n, a in config.actuators.items()} == {
        "hip_thigh": "DCMotorCfg",
        "calf": "DCMotorCfg",
    }
    motors = driven_by(robots, config.actuators.values(), names)
    assert set(motors) == set(spec.joint_order)
    for field, calf, other in (
        ("effort_limit", 45.43, 23.7),
        ("saturation_effort", 45.43, 23.7),
        ("velocity_limit", 15.7, 30.1),
        ("stiffness", 30.0, 20.0),
        ("damping", 0.75, 0.5),
        ("armature", 0.04, 0.01),
        ("friction", 0.0, 0.0),
    ):
        values = {joint: getattr(motors[joint], field) for joint in spec.joint_order}
        assert values == robots.of(spec, calf=calf, other=other)
    assert config.soft_joint_pos_limit_factor == 0.9


def test_isaaclab_actuators_of_biped(load, modules, robots):
    joints = ("l_hip", "l_knee", "l_ankle", "r_hip", "r_knee", "r_ankle", "torso")
    spec = robots.plain(joints, velocity=dict.fromkeys(joints, 20.0), feet=("l_foot", "r_foot"))
    roles = {joint: joint.partition("_")[2] for joint in joints[:6]}
    actuators = load("isaaclab", spec, modules, roles=roles).ARM_CFG.actuators
    assert {type(each).__name__ for each in actuators.values()} == {"ImplicitActuatorCfg"}
    names = {name: each.joint_names_expr for name, each in actuators.items()}
    assert names["feet"] == [".*_ankle"]
    assert names["upper_body"] == ["torso"]
    legs = driven_by(robots, [actuators["legs"]], joints)
    assert set(joints) - set(legs) == {"l_ankle", "r_ankle", "torso"}


def test_isaaclab_motors_are_named_after_words_or_numbered(load, modules, robots):
    joints = ("joint_1", "knee", "k" * 20, "k" * 21)
    feet = tuple(f"foot_{k}" for k in range(4))
    spec = robots.plain(joints, velocity=dict.fromkeys(joints, 20.0), feet=feet)
    actuators = load("isaaclab", spec, modules).ARM_CFG.actuators
    assert list(actuators) == ["legs_1", "knee", "k" * 20, "legs_4"]


def test_isaaclab_velocity_task(load, modules, robots, request):
    spec = robots.quadruped()
    loaded = load("isaaclab", spec, modules, bodies=robots.bodies, has_fixed_feet=True)
    task = loaded.RoughEnvCfg()
    assert task.scene.robot.prim_path == "{ENV_REGEX_NS}/Robot"
    is_nested = "v3" in request.node.callspec.id  # the bodies lie in their parents, also the feet
    assert loaded.QUAD_4_CFG.spawn.merge_fixed_joints is not is_nested
    parents = "{ENV_REGEX_NS}/Robot/(.*/)?" if is_nested else "{ENV_REGEX_NS}/Robot/"
    assert task.scene.height_scanner.prim_path == parents + "base"
    assert task.scene.contact_forces.prim_path == parents + ".*"
    assert task.actions.joint_pos.joint_names == [".*"]
    assert not hasattr(task.actions, "joint_vel")
    scale = robots.resolved(task.actions.joint_pos.scale, spec.joint_order)
    assert scale == robots.of(spec, calf=0.2, other=0.25)
    assert task.events.reset_robot_joints.params["position_range"] == (0.6, 1.4)
    assert task.events.add_base_mass.params["asset_cfg"].body_names == "base"
    assert task.rewards.feet_air_time.params["sensor_cfg"].body_names == [".*_foot"]
    penalized = task.rewards.undesired_contacts.params["sensor_cfg"].body_names
    assert penalized == [".*_thigh", ".*_calf"]
    assert task.terminations.base_contact.params["sensor_cfg"].body_names == ["base"]


def test_isaaclab_velocity_task_without_contacts_and_actuators(load, modules, robots):
    spec = robots.quadruped(penalized_contacts=(), termination_contacts=())
    task = load("isaaclab", spec, modules, passive_joints=["tail_joint"]).RoughEnvCfg()
    assert task.rewards.undesired_contacts is task.terminations.base_contact is None
    actions = SimpleNamespace(joint_names_expr=task.actions.joint_pos.joint_names)
    names = (*spec.joint_order, "tail_joint")
    assert set(driven_by(robots, [actions], names)) == set(spec.joint_order)


def test_isaaclab_config_of_arm(load, modules, robots):
    spec = robots.plain(("joint1", "joint10"), effort={"joint1": 5.0})
    loaded = load("isaaclab", spec, modules)
    actuator = loaded.ARM_CFG.actuators["joints"]
    assert loaded.ARM_CFG.spawn.fix_base is True
    assert loaded.ARM_CFG.init_state.pos == (0.0, 0.0, 0.0)
    assert actuator.effort_limit_sim == {"joint1": 5.0}
    assert not hasattr(actuator, "velocity_limit_sim")  # unknown: the limit of the URDF is used
    assert actuator.stiffness == {"joint1": 0.5, "joint10": 1.5}
    assert loaded.ACTION_SCALE == 0.25
    assert not hasattr(loaded, "RoughEnvCfg")


def test_isaaclab_config_of_wheels(load, modules, robots):
    spec = robots.wheeled(velocity={})
    loaded = load("isaaclab", spec, modules, bodies=robots.bodies)
    wheels, others = robots.wheels_of(spec)
    actuators = loaded.QUAD_4_CFG.actuators
    assert set(actuators) == {"joints", "wheels"}
    for name, joints in (("joints", others), ("wheels", wheels)):
        assert set(driven_by(robots, [actuators[name]], spec.joint_order)) == set(joints)
    assert (actuators["joints"].stiffness, actuators["wheels"].stiffness) == (20.0, 0.0)
    assert (actuators["joints"].damping, actuators["wheels"].damping) == (0.5, 0.75)
    efforts = robots.resolved(actuators["wheels"].effort_limit_sim, wheels)
    assert efforts == dict.fromkeys(wheels, 45.43)
    assert (loaded.ACTION_SCALE, loaded.SPEED_SCALE) == (0.25, 5.0)
    actions = loaded.RoughEnvCfg().actions
    assert actions.joint_pos.joint_names == [".*_hip_joint", ".*_thigh_joint"]
    assert actions.joint_vel.joint_names == [".*_calf_joint"]
    assert (actions.joint_vel.asset_name, actions.joint_vel.scale) == ("robot", 5.0)
    text = Path(loaded.__file__).read_text()
    assert "[rad/s or m/s]; suggested: a share\nSPEED_SCALE = 5.0\n" in text


def test_isaaclab_config_with_only_wheels(load, modules, robots):
    spec = robots.plain(("left", "right"), stiffness={".*": 0.0})
    loaded = load("isaaclab", spec, modules)
    assert list(loaded.ARM_CFG.actuators) == ["wheels"]
    assert loaded.SPEED_SCALE == 0.25
    assert not hasattr(loaded, "ACTION_SCALE")
