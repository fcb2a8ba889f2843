"""Write mjlab's velocity task for a robot: what depends on the robot, and two registered tasks."""

import re

from terrainkit_robots.export.mjcf import COLLISION_SUFFIX
from terrainkit_robots.onboarding.frameworks import source
from terrainkit_robots.onboarding.frameworks.config_robot import ConfigRobot
from terrainkit_robots.onboarding.frameworks.naming import class_name, package_name
from terrainkit_robots.onboarding.frameworks.patterns import (
    merge_names,
    merge_patterns,
    mjlab_patterns,
)
from terrainkit_robots.spec.robot_spec import RobotSpec

IMPORTS = """\
from mjlab.envs import ManagerBasedRlEnvCfg
from mjlab.managers import RewardTermCfg, TerminationTermCfg
from mjlab.sensor import ContactMatch, ContactSensorCfg, ObjRef, RingPatternCfg
from mjlab.tasks.registry import register_mjlab_task
from mjlab.tasks.velocity import mdp
from mjlab.tasks.velocity.config.go1.rl_cfg import unitree_go1_ppo_runner_cfg
from mjlab.tasks.velocity.rl import VelocityOnPolicyRunner
from mjlab.tasks.velocity.velocity_env_cfg import make_velocity_env_cfg"""
"""Imports of the task."""

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
$names


def ground_contact(name, bodies, mode="body", **options) -> ContactSensorCfg:
    """Return a sensor of the contacts of some bodies with the ground."""
    return ContactSensorCfg(
        name=name,
        primary=ContactMatch(mode=mode, pattern=bodies, entity="robot"),
        secondary=ContactMatch(mode="body", pattern="terrain"),
        **options,
    )


def velocity_env_cfg(
    rough: bool,
    play: bool = False,
    map_path: str | None = None,
) -> ManagerBasedRlEnvCfg:
    """Return mjlab's velocity task for this robot, on flat or rough ground, or on a map.npz."""
    cfg = make_velocity_env_cfg()
    cfg.scene.entities = {"robot": get_robot_cfg()}
    cfg.viewer.body_name = BASE
    $actions
    for group in cfg.observations.values():
        group.terms["base_lin_vel"].params["sensor_name"] = "robot/linear_velocity"
        group.terms["base_ang_vel"].params["sensor_name"] = "robot/angular_velocity"
    cfg.events["foot_friction"].params["asset_cfg"].geom_names = FOOT_GEOMS
    cfg.events["base_com"].params["asset_cfg"].body_names = (BASE,)

    sensors = {sensor.name: sensor for sensor in cfg.scene.sensors}
    sensors["terrain_scan"].frame.name = BASE
    foot_scan = sensors["foot_height_scan"]
    foot_scan.frame = tuple(ObjRef("site", foot, "robot") for foot in FEET)
    foot_scan.pattern = RingPatternCfg.single_ring(radius=0.04, num_samples=4)
    feet = ground_contact("feet_ground_contact", FEET, "subtree", reduce="netforce")
    feet.track_air_time = True
    own_bodies = ContactMatch(mode="subtree", pattern=BASE, entity="robot")
    substeps = {"reduce": "none", "history_length": cfg.decimation}
    contacts = [ContactSensorCfg("self_collision", own_bodies, own_bodies, **substeps)]
    if PENALIZED:
        contacts.append(ground_contact("undesired_contact", PENALIZED, **substeps))
    for sensor in contacts:
        cfg.rewards[f"{sensor.name}s"] = RewardTermCfg(
            func=mdp.self_collision_cost,
            weight=-0.1,
            params={"sensor_name": sensor.name},
        )
    if TERMINATION:
        contacts.append(ground_contact("illegal_contact", TERMINATION, **substeps))
        cfg.terminations["illegal_contact"] = TerminationTermCfg(
            func=mdp.illegal_contact,
            params={"sensor_name": "illegal_contact"},
        )
    sensors |= {sensor.name: sensor for sensor in (feet, *contacts)}

    for name in ("upright", "body_ang_vel"):
        cfg.rewards[name].params["asset_cfg"].body_names = (BASE,)
    for name in ("foot_clearance", "foot_slip"):
        cfg.rewards[name].params["asset_cfg"].site_names = FEET
    for name in ("foot_clearance", "foot_swing_height"):
        cfg.rewards[name].params["target_height"] = FOOT_CLEARANCE
    cfg.rewards["pose"].params["std_standing"] = {".*": 0.05}
    cfg.rewards["pose"].params["std_walking"] = WALKING_STD
    cfg.rewards["pose"].params["std_running"] = RUNNING_STD

    if rough:
        cfg.sim.nconmax = 100
        cfg.sim.contact_sensor_maxmatch = cfg.sim.mujoco.ccd_iterations = 500
        cfg.scene.terrain.terrain_generator.curriculum = True
        if map_path is not None:
            from terrainkit.integrations.mjlab import (
                terrain_entity_cfg,
                use_terrain_curriculum,
            )

            cfg.scene.terrain = terrain_entity_cfg(map_path)
            use_terrain_curriculum(cfg)
        cfg.rewards["upright"].params["terrain_sensor_names"] = ("terrain_scan",)
    else:
        cfg.sim.nconmax, cfg.sim.njmax = None, 500
        cfg.scene.terrain.terrain_type = "plane"
        cfg.scene.terrain.terrain_generator = None
        del sensors["terrain_scan"]
        for group in cfg.observations.values():
            del group.terms["height_scan"]
        del cfg.curriculum["terrain_levels"], cfg.terminations["out_of_terrain_bounds"]
    if play:
        cfg.episode_length_s = 1e9
        cfg.observations["actor"].enable_corruption = False
        del cfg.events["push_robot"]
        cfg.curriculum = {}
        cfg.scene.terrain.max_init_terrain_level = None  # robots on all levels
    cfg.scene.sensors = tuple(sensors.values())
    return cfg


def register_tasks(map_path: str | None = None) -> None:
    """Register the tasks, or with a map the rough one on it, with the PPO of mjlab's Go1."""
    runner = replace(unitree_go1_ppo_runner_cfg(), experiment_name=EXPERIMENT)
    tasks = ((FLAT_TASK, False), (ROUGH_TASK, True))
    for task_id, rough in tasks if map_path is None else tasks[1:]:
        register_mjlab_task(
            task_id=task_id,
            env_cfg=velocity_env_cfg(rough, map_path=map_path),
            play_env_cfg=velocity_env_cfg(rough, play=True, map_path=map_path),
            rl_cfg=runner,
            runner_cls=VelocityOnPolicyRunner,
        )


if __name__ == "__main__":
    from mjlab.scripts.train import main

    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    parser.add_argument("--map")
    options, sys.argv[1:] = parser.parse_known_args()
    register_tasks(options.map)
    main()
'''

_POSITION_ACTIONS = 'cfg.actions["joint_pos"].scale = ACTION_SCALE'

_NAMED_POSITION_ACTIONS = 'cfg.actions["joint_pos"].actuator_names = tuple(ACTION_SCALE)'

_NO_POSITION_ACTIONS = 'del cfg.actions["joint_pos"]'

_VELOCITY_ACTIONS = [
    'cfg.actions["joint_vel"] = mdp.JointVelocityActionCfg(',
    '    entity_name="robot",',
    "    actuator_names=tuple(SPEED_SCALE),",
    "    scale=SPEED_SCALE,",
    ")",
]


def task_id(spec: RobotSpec, terrain: str) -> str:
    """Return the name of the task on a terrain, `Flat` or `Rough`."""
    return f"Mjlab-Velocity-{terrain}-{class_name(spec.name)}"


def task(robot: ConfigRobot) -> list[str]:
    """Return the names that the task needs, its functions, and the command that trains it."""
    return ["", "", *source.fill(_TASK, names=_names(robot), actions=_actions(robot))]


def _names(robot: ConfigRobot) -> list[str]:
    spec = robot.spec
    base = mjlab_patterns(robot.check_bodies([spec.base], "base"))[spec.base]
    # Feet are listed, since sites, sensors and rewards have to agree on their order.
    feet = [name.rsplit("/", maxsplit=1)[-1] for name in robot.check_bodies(spec.feet, "feet")]
    geoms = [rf"{re.escape(foot)}{COLLISION_SUFFIX}\d*" for foot in feet]
    return [
        *source.assignment("FLAT_TASK", source.string_literal(task_id(spec, "Flat"))),
        *source.assignment("ROUGH_TASK", source.string_literal(task_id(spec, "Rough"))),
        f"EXPERIMENT = {source.string_literal(package_name(spec.name))}",
        "",
        "# Names in robot.xml; a pattern matches a whole name.",
        *source.assignment("BASE", source.string_literal(base)),
        *source.format_collection("FEET = ", source.format_strings(feet), "()"),
        *source.format_collection("FOOT_GEOMS = ", source.format_strings(geoms), "()"),
        "# Bodies whose contacts with the ground are penalized, or end an episode.",
        *_bodies(robot, "PENALIZED", "penalized_contacts"),
        *_bodies(robot, "TERMINATION", "termination_contacts"),
        "# Target height of a swinging foot [m].",
        f"FOOT_CLEARANCE = {_foot_clearance(spec.leg_length)}",
        "# Standard deviation of the pose reward, by joint [rad].",
        *_pose_std(robot, "WALKING_STD", 0),
        *_pose_std(robot, "RUNNING_STD", 1),
    ]


def _bodies(robot: ConfigRobot, name: str, field: str) -> list[str]:
    bodies = robot.check_bodies(getattr(robot.spec, field), field)
    patterns = merge_names(bodies, mjlab_patterns(robot.all_bodies))
    return source.format_collection(f"{name} = ", source.format_strings(patterns), "()")


def _foot_clearance(leg_length: float | None) -> float:
    height = _MAX_CLEARANCE if leg_length is None else _CLEARANCE * leg_length
    return max(0.01, round(min(height, _MAX_CLEARANCE), 2))


def _pose_std(robot: ConfigRobot, name: str, index: int) -> list[str]:
    joints = robot.all_joints
    stds = {
        joint: _POSE_STD.get(robot.roles.get(joint, ""), _DEFAULT_POSE_STD)[index]
        for joint in joints
    }
    entries = source.dict_entries(merge_patterns(stds, mjlab_patterns(joints)))
    return source.format_collection(f"{name} = ", entries, "{}")


def _actions(robot: ConfigRobot) -> list[str]:
    """Return the source of the actions with position targets and velocity targets."""
    velocity = _VELOCITY_ACTIONS if robot.velocity_joints else []
    if not robot.position_joints:
        return [_NO_POSITION_ACTIONS, *velocity]
    return [_POSITION_ACTIONS, *[_NAMED_POSITION_ACTIONS] * bool(velocity), *velocity]
