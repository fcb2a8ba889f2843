"""Write the task of a robot for LeggedGym-Ex: walking in Genesis, Isaac Gym and Isaac Lab."""

import warnings
from pathlib import Path
from shlex import quote
from tempfile import TemporaryDirectory

from terrainkit.errors import ExportError, TerrainkitWarning, listing
from terrainkit.map.terrain_map import TerrainMap
from terrainkit_robots.onboarding.frameworks import legged_robot, source
from terrainkit_robots.onboarding.frameworks.config_robot import ConfigRobot
from terrainkit_robots.onboarding.frameworks.naming import class_name, package_name
from terrainkit_robots.spec.robot_spec import RobotSpec
from terrainkit_robots.text import count

LEGGED_ONLY = True
"""Whether the framework supports only robots with legs."""

MAP_FILES = ("terrain.py", "terrain.npz")
"""The files of a map in the package of a robot."""

_NAMES = frozenset({"base", "bipedal_walker", "g1", "go2", "tron1_pf", "tron1_sf", "terrain"})
"""The folders in `legged_gym/envs` of LeggedGym-Ex 0.3.0, and the module of a map."""

_NUM_HEIGHTS = 17 * 11
"""Number of measured heights in the observations on a map."""


def config_files(robot: ConfigRobot) -> dict[str, str]:
    """Return the files of the package of the robot in `legged_gym/envs`, by name.

    Raises:
        ConfigError: if LeggedGym-Ex does not support the names of the bodies.
        ExportError: if LeggedGym-Ex has a task of that name.
    """
    package = package_name(robot.spec.name)
    if package in _NAMES:
        raise ExportError(
            f"name of the task: got {package!r}, a name in LeggedGym-Ex; expected another name, "
            f"such as --name my_{package}"
        )
    about = f"{robot.title} for LeggedGym-Ex"
    task = source.fill(
        "leggedgym_ex_task",
        about=source.docstring([f"{about}: the environment and its task, written by terrainkit."]),
        name=class_name(robot.spec.name),
        package=package,
        speed_scale=legged_robot.speed_scale(robot),
        terrain=source.fill("leggedgym_ex_map", package=package) if robot.has_map else [],
        wheels=[*source.fill("leggedgym_ex_wheels"), ""] if robot.velocity_joints else [],
        dof_pos_scale="self.dof_pos_scale" if robot.velocity_joints else "scales.dof_pos",
    )
    return {
        f"{package}_config.py": config_text(robot),
        f"{package}.py": source.join_lines([task]),
        "__init__.py": source.join_lines([source.docstring([f"{about}."])]),
    }


def config_text(robot: ConfigRobot) -> str:
    """Return the text of the configuration.

    Raises:
        ConfigError: if LeggedGym-Ex does not support the names of the bodies.
    """
    count, package = len(robot.spec.joint_order), package_name(robot.spec.name)
    ground = "map" if robot.has_map else "plane"
    num_observations = 9 + 3 * count + (_NUM_HEIGHTS if robot.has_map else 0)
    config = source.fill(
        "leggedgym_ex_config",
        about=source.docstring(_about(robot)),
        name=class_name(robot.spec.name),
        package=package,
        num_observations=str(num_observations),
        num_privileged_obs=str(num_observations + 3),
        terrain=source.fill(f"leggedgym_ex_{ground}_terrain"),
        ground_scales=source.fill(f"leggedgym_ex_{ground}_scales"),
        num_actions=str(count),
        init_state=legged_robot.init_state(robot),
        control=_control(robot),
        asset=_asset(robot),
        rewards=legged_robot.rewards(robot),
        foot_height=source.float_literal(robot.foot_height),
        dof_pos_limits=_dof_pos_limits(robot),
    )
    return source.join_lines([config])


def map_files(path: Path) -> dict[str, bytes]:
    """Return the files of a map for the package of a robot, by name.

    Args:
        path: The map, a .npz file.

    Raises:
        MapFileError: if the file is missing, or not a map.
        ExportError: if Isaac Gym does not support the friction or the solids of the map.

    Warns:
        TerrainkitWarning: if Genesis does not support the map.
    """
    terrain_map = TerrainMap.load(path)
    if num_solids := len(terrain_map.solids):
        warnings.warn(
            f"{path} has {count(num_solids, 'solid')}, which the heightfields of LeggedGym-Ex in "
            "Genesis lose: the task starts in Isaac Gym and Isaac Lab only",
            TerrainkitWarning,
            stacklevel=2,
        )
    with TemporaryDirectory() as folder:
        terrain_map.save(Path(folder, MAP_FILES[0]))
        return {name: Path(folder, name).read_bytes() for name in MAP_FILES}


def train_commands(spec: RobotSpec, folder: Path) -> tuple[str, list[str]]:
    """Return where to train a robot, and the commands."""
    return "the folder of LeggedGym-Ex", _commands(package_name(spec.name), str(folder.absolute()))


def _commands(package: str, folder: str) -> list[str]:
    # The file may lack a newline at the end. With /., a second copy replaces the first one.
    line = rf"\nfrom legged_gym.envs.{package} import {package}\n"
    return [
        f"cp -r {quote(folder)}/. legged_gym/envs/{package}",
        f"printf '{line}' >> legged_gym/envs/__init__.py",
        f"SIMULATOR=genesis python legged_gym/scripts/train.py --task={package} --headless",
    ]


def _about(robot: ConfigRobot) -> list[str]:
    package = package_name(robot.spec.name)
    ground = "the map of terrain.py" if robot.has_map else "flat ground"
    return [
        f"{robot.title} for LeggedGym-Ex: {ground}.",
        source.GENERATED_NOTE,
        "Train it in the folder of LeggedGym-Ex, in Isaac Gym without SIMULATOR:",
        "\n".join(source.indent(_commands(package, "FOLDER"))),
        "The files read robot.urdf. Versions of LeggedGym-Ex with xml_file read robot.xml in "
        "Genesis. With Isaac Lab, legged_gym/simulator/isaaclab_simulator.py selects actuators "
        f"by asset.name: add a branch for {source.string_literal(package)}.",
        "With Isaac Gym, LeggedGym-Ex uses the permutation from its joint order to dof_names also "
        "for the inverse. This is correct only if the permutation is its own inverse; otherwise "
        "set dof_names, dof_armature and dof_vel_limits in the order that it prints.",
    ]


def _control(robot: ConfigRobot) -> list[str]:
    return [
        *legged_robot.gains(
            robot,
            "Isaac Gym and Isaac Lab use the last matching key, so the order matters; "
            "Genesis fails with several matching keys: rename the joint.",
        ),
        "# Control time step [s].",
        "dt = 0.02",
    ]


def _dof_pos_limits(robot: ConfigRobot) -> list[str]:
    """Return the scale of the reward for joint limits."""
    limits = robot.spec.joint_order if robot.limits is None else robot.limits
    if unlimited := [joint for joint in robot.spec.joint_order if joint not in limits]:
        note = f"LeggedGym-Ex computes NaN for joints without limits: {listing(unlimited)}."
        return [*source.comment(note, depth=3), "dof_pos_limits = 0.0"]
    return ["dof_pos_limits = -1.0"]


def _asset(robot: ConfigRobot) -> list[str]:
    spec = robot.spec
    armature, velocities = robot.joint_values("armature"), robot.joint_values("velocity")
    armatures = [source.float_literal(armature.get(joint, 0.0)) for joint in spec.joint_order]
    limits = [
        source.float_literal(velocities[joint]) if joint in velocities else 'float("inf")'
        for joint in spec.joint_order
    ]
    base = robot.check_bodies([spec.base], "base")[0]
    return [
        legged_robot.asset_name(robot),
        *legged_robot.path_in_folder("file", spec.urdf),
        *legged_robot.path_in_folder("xml_file", spec.mjcf),
        *legged_robot.contacts(robot),
        *source.assignment("base_link_name", source.string_literal(base), depth=2),
        "# The order of actions and observations.",
        *source.format_collection("dof_names = ", source.format_strings(spec.joint_order), depth=2),
        *robot.provenance_comment("armature", depth=2, prefix="In the order of dof_names"),
        *source.format_collection("dof_armature = ", armatures, depth=2),
        *robot.provenance_comment("velocity", depth=2, prefix="In the order of dof_names"),
        *source.format_collection("dof_vel_limits = ", limits, depth=2),
        *source.comment("Bodies on fixed joints that Genesis does not merge.", depth=2),
        *source.format_collection("links_to_keep = ", source.format_strings(spec.feet), depth=2),
        *source.fill("legged_robot_shapes"),
    ]
