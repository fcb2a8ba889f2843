"""Write the velocity task of a robot for mjlab: flat and rough ground, and a PPO runner."""

import re
from collections.abc import Mapping

from terrainkit_robots.export.mjcf import COLLISION_SUFFIX
from terrainkit_robots.onboarding.frameworks.config_robot import ConfigRobot
from terrainkit_robots.onboarding.frameworks.naming import class_name, package_name
from terrainkit_robots.onboarding.frameworks.patterns import (
    merge_names,
    merge_patterns,
    mjlab_patterns,
)
from terrainkit_robots.onboarding.frameworks.source import (
    assignment,
    comment,
    dict_entries,
    format_collection,
    format_strings,
    string_literal,
)
from terrainkit_robots.spec.robot_spec import RobotSpec

IMPORTS = """
from mjlab.envs import ManagerBasedRlEnvCfg
from mjlab.envs import mdp as envs_mdp
{actions}from mjlab.managers.event_manager import EventTermCfg
from mjlab.managers.reward_manager import RewardTermCfg
from mjlab.managers.termination_manager import TerminationTermCfg
from mjlab.rl import (
    RslRlModelCfg,
    RslRlOnPolicyRunnerCfg,
    RslRlPpoAlgorithmCfg,
)
from mjlab.sensor import ContactMatch, ContactSensorCfg, ObjRef, RingPatternCfg
from mjlab.tasks.registry import register_mjlab_task
from mjlab.tasks.velocity import mdp
from mjlab.tasks.velocity.rl import VelocityOnPolicyRunner
from mjlab.tasks.velocity.velocity_env_cfg import make_velocity_env_cfg
"""
"""Imports of the task."""

_ACTIONS_IMPORT = "from mjlab.envs.mdp.actions import JointVelocityActionCfg\n"

_POSE_STD = {
    "hip": (0.3, 0.5),
    "knee": (0.5, 0.8),
    "ankle": (0.2, 0.3),
    "roll": (0.15, 0.2),
    "yaw": (0.15, 0.2),
}
"""Standard deviation of the pose reward by role, walking and running [rad]."""

_DEFAULT_POSE_STD = (0.15, 0.3)
"""The same of other joints, such as arms."""

_CLEARANCE = 0.25
"""Target height of a swinging foot over the leg length, for legs that are too short for mjlab's."""

_MAX_CLEARANCE = 0.1
"""Target height of a swinging foot in mjlab [m]."""

_TASK = '''
def contact_sensor(name, bodies, mode, **options) -> ContactSensorCfg:
    """Return a sensor of the contacts of some bodies with the ground."""
    return ContactSensorCfg(
        name=name,
        primary=ContactMatch(mode=mode, pattern=bodies, entity="robot"),
        secondary=ContactMatch(mode="body", pattern="terrain"),
        fields=("found", "force"),
        num_slots=1,
        **options,
    )


def rough_env_cfg(play: bool = False) -> ManagerBasedRlEnvCfg:
    """Return mjlab's velocity task on rough ground for this robot."""
    cfg = make_velocity_env_cfg()
    cfg.sim.mujoco.ccd_iterations = 500
    cfg.sim.contact_sensor_maxmatch = 500
    cfg.sim.nconmax = 100
    cfg.viewer.body_name = BASE
    cfg.scene.entities = {"robot": get_robot_cfg()}
    cfg.scene.terrain.terrain_generator.curriculum = True

    # Sensors.
    for sensor in cfg.scene.sensors:
        if sensor.name == "terrain_scan":
            sensor.frame.name = BASE
        if sensor.name == "foot_height_scan":
            sensor.frame = tuple(ObjRef("site", foot, "robot") for foot in FEET)
            sensor.pattern = RingPatternCfg.single_ring(radius=0.04, num_samples=4)
    body = ContactMatch(mode="subtree", pattern=BASE, entity="robot")
    cfg.scene.sensors += (
        contact_sensor(
            "feet_ground_contact",
            FEET,
            "subtree",
            reduce="netforce",
            track_air_time=True,
        ),
        ContactSensorCfg(
            name="self_collision",
            primary=body,
            secondary=body,
            fields=("found", "force"),
            reduce="none",
            num_slots=1,
            history_length=4,
        ),
    )
    for terms in (cfg.observations["actor"].terms, cfg.observations["critic"].terms):
        terms["base_lin_vel"].params["sensor_name"] = "robot/linear_velocity"
        terms["base_ang_vel"].params["sensor_name"] = "robot/angular_velocity"

    # Actions.
{actions}
    # Randomization.
    cfg.events["foot_friction"].params["asset_cfg"].geom_names = FOOT_GEOMS
    cfg.events["base_com"].params["asset_cfg"].body_names = (BASE,)

    # Rewards. The file has no sensor of the angular momentum.
    del cfg.rewards["angular_momentum"]
    cfg.rewards["pose"].params["std_standing"] = {".*": 0.05}
    cfg.rewards["pose"].params["std_walking"] = WALKING_STD
    cfg.rewards["pose"].params["std_running"] = RUNNING_STD
    cfg.rewards["upright"].params["asset_cfg"].body_names = (BASE,)
    cfg.rewards["upright"].params["terrain_sensor_names"] = ("terrain_scan",)
    cfg.rewards["body_ang_vel"].params["asset_cfg"].body_names = (BASE,)
    for name in ("foot_clearance", "foot_slip"):
        cfg.rewards[name].params["asset_cfg"].site_names = FEET
    for name in ("foot_clearance", "foot_swing_height"):
        cfg.rewards[name].params["target_height"] = FOOT_CLEARANCE
    cfg.rewards["self_collisions"] = RewardTermCfg(
        func=mdp.self_collision_cost,
        weight=-0.1,
        params={"sensor_name": "self_collision"},
    )
    if PENALIZED:
        cfg.scene.sensors += (
            contact_sensor(
                "undesired_contact",
                PENALIZED,
                "body",
                reduce="none",
                history_length=4,
            ),
        )
        cfg.rewards["undesired_contacts"] = RewardTermCfg(
            func=mdp.self_collision_cost,
            weight=-0.1,
            params={"sensor_name": "undesired_contact"},
        )

    # Terminations.
    if TERMINATION:
        cfg.scene.sensors += (
            contact_sensor(
                "illegal_contact",
                TERMINATION,
                "body",
                reduce="none",
                history_length=4,
            ),
        )
        cfg.terminations["illegal_contact"] = TerminationTermCfg(
            func=mdp.illegal_contact,
            params={"sensor_name": "illegal_contact"},
        )

    if play:
        cfg.episode_length_s = 1e9
        cfg.observations["actor"].enable_corruption = False
        cfg.events.pop("push_robot")
        cfg.terminations.pop("out_of_terrain_bounds")
        cfg.curriculum = {}
        cfg.events["randomize_terrain"] = EventTermCfg(
            func=envs_mdp.randomize_terrain,
            mode="reset",
        )
        generator = cfg.scene.terrain.terrain_generator
        generator.curriculum = False
        generator.num_rows = generator.num_cols = 5
    return cfg


def flat_env_cfg(play: bool = False) -> ManagerBasedRlEnvCfg:
    """Return mjlab's velocity task on flat ground for this robot."""
    cfg = rough_env_cfg(play)
    cfg.sim.nconmax = None
    cfg.sim.njmax = 500
    cfg.sim.mujoco.ccd_iterations = 50
    cfg.sim.contact_sensor_maxmatch = 64
    cfg.scene.terrain.terrain_type = "plane"
    cfg.scene.terrain.terrain_generator = None
    cfg.scene.sensors = tuple(
        sensor for sensor in cfg.scene.sensors if sensor.name != "terrain_scan"
    )
    del cfg.observations["actor"].terms["height_scan"]
    del cfg.observations["critic"].terms["height_scan"]
    del cfg.rewards["upright"].params["terrain_sensor_names"]
    cfg.terminations.pop("out_of_terrain_bounds", None)
    cfg.curriculum.pop("terrain_levels", None)
    cfg.events.pop("randomize_terrain", None)
    return cfg


def runner_cfg() -> RslRlOnPolicyRunnerCfg:
    """Return the configuration of PPO."""
    hidden_dims = (512, 256, 128)
    return RslRlOnPolicyRunnerCfg(
        actor=RslRlModelCfg(
            hidden_dims=hidden_dims,
            obs_normalization=True,
            distribution_cfg={
                "class_name": "GaussianDistribution",
                "init_std": 1.0,
                "std_type": "scalar",
            },
        ),
        critic=RslRlModelCfg(hidden_dims=hidden_dims, obs_normalization=True),
        algorithm=RslRlPpoAlgorithmCfg(entropy_coef=0.01),
        experiment_name=EXPERIMENT,
        max_iterations=10_000,
    )


def register_tasks() -> None:
    """Register the tasks, once per process."""
    for task_id, make_cfg in ((FLAT_TASK, flat_env_cfg), (ROUGH_TASK, rough_env_cfg)):
        register_mjlab_task(
            task_id=task_id,
            env_cfg=make_cfg(),
            play_env_cfg=make_cfg(play=True),
            rl_cfg=runner_cfg(),
            runner_cls=VelocityOnPolicyRunner,
        )


if __name__ == "__main__":
    from mjlab.scripts.train import main

    register_tasks()
    main()
'''

_POSITION_ACTIONS = """\
    cfg.actions["joint_pos"].scale = ACTION_SCALE
"""

_NAMED_POSITION_ACTIONS = """\
    cfg.actions["joint_pos"].actuator_names = tuple(ACTION_SCALE)
"""

_NO_POSITION_ACTIONS = """\
    del cfg.actions["joint_pos"]
"""

_VELOCITY_ACTIONS = """\
    cfg.actions["joint_vel"] = JointVelocityActionCfg(
        entity_name="robot",
        actuator_names=tuple(SPEED_SCALE),
        scale=SPEED_SCALE,
    )
"""


def task_id(spec: RobotSpec, terrain: str) -> str:
    """Return the name of the task on a terrain, `Flat` or `Rough`."""
    return f"Mjlab-Velocity-{terrain}-{class_name(spec.name)}"


def imports(robot: ConfigRobot) -> list[str]:
    """Return the imports of the task."""
    actions = _ACTIONS_IMPORT * bool(robot.velocity_joints)
    return IMPORTS.format(actions=actions).strip().split("\n")


def task(robot: ConfigRobot) -> list[str]:
    """Return the names that the task needs, its functions, and the command that trains it."""
    spec = robot.spec
    base = mjlab_patterns(robot.check_bodies([spec.base], "base"))[spec.base]
    # Feet are listed, since sites, sensors and rewards have to agree on their order.
    feet = [name.rsplit("/", maxsplit=1)[-1] for name in robot.check_bodies(spec.feet, "feet")]
    lines = [
        "",
        "",
        *assignment("FLAT_TASK", string_literal(task_id(spec, "Flat"))),
        *assignment("ROUGH_TASK", string_literal(task_id(spec, "Rough"))),
        f"EXPERIMENT = {string_literal(package_name(spec.name))}",
        "",
        "# Names in robot.xml; a pattern matches a whole name.",
        *assignment("BASE", string_literal(base)),
        *format_collection("FEET = ", format_strings(feet), "()"),
        *_foot_geoms(feet),
        *comment("Bodies whose contacts with the ground are penalized, or end an episode."),
        *_names(robot, "PENALIZED", "penalized_contacts"),
        *_names(robot, "TERMINATION", "termination_contacts"),
        *comment("Target height of a swinging foot [m]."),
        f"FOOT_CLEARANCE = {_foot_clearance(spec.leg_length)}",
        *_pose_std(robot),
        "",
    ]
    functions = _TASK.replace("{actions}\n", _actions(robot))
    return [*lines, *functions.rstrip().split("\n")]


def _names(robot: ConfigRobot, name: str, field: str) -> list[str]:
    bodies = robot.check_bodies(getattr(robot.spec, field), field)
    patterns = merge_names(bodies, mjlab_patterns(robot.all_bodies))
    return format_collection(f"{name} = ", format_strings(patterns), "()")


def _foot_geoms(feet: list[str]) -> list[str]:
    geoms = [rf"{re.escape(foot)}{COLLISION_SUFFIX}\d*" for foot in feet]
    return format_collection("FOOT_GEOMS = ", format_strings(geoms), "()")


def _foot_clearance(leg_length: float | None) -> float:
    height = _MAX_CLEARANCE if leg_length is None else _CLEARANCE * leg_length
    return max(0.01, round(min(height, _MAX_CLEARANCE), 2))


def _pose_std(robot: ConfigRobot) -> list[str]:
    """Return the standard deviations of the pose reward of all joints."""
    joints = robot.all_joints
    std = {joint: _POSE_STD.get(robot.roles.get(joint, ""), _DEFAULT_POSE_STD) for joint in joints}
    patterns = mjlab_patterns(joints)
    lines = comment("Standard deviation of the pose reward, by joint [rad].")
    for name, index in (("WALKING_STD", 0), ("RUNNING_STD", 1)):
        values = {joint: both[index] for joint, both in std.items()}
        lines += _table(name, values, patterns)
    return lines


def _table(name: str, values: Mapping[str, float], patterns: Mapping[str, str]) -> list[str]:
    return format_collection(f"{name} = ", dict_entries(merge_patterns(values, patterns)), "{}")


def _actions(robot: ConfigRobot) -> str:
    has_positions, has_velocities = bool(robot.position_joints), bool(robot.velocity_joints)
    if not has_positions:
        return _NO_POSITION_ACTIONS + _VELOCITY_ACTIONS
    names = _NAMED_POSITION_ACTIONS * has_velocities
    return _POSITION_ACTIONS + names + _VELOCITY_ACTIONS * has_velocities
