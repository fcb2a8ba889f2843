"""Write the configuration of a robot for Genesis: entity, gains and default pose."""

from terrainkit_robots.onboarding.frameworks import source
from terrainkit_robots.onboarding.frameworks.config_robot import ConfigRobot
from terrainkit_robots.onboarding.frameworks.naming import package_name

LEGGED_ONLY = False
"""Whether the framework supports only robots with legs."""

_TABLES = {
    "DEFAULT_POSE": "default_pose",
    "STIFFNESS": "stiffness",
    "DAMPING": "damping",
    "EFFORT": "effort",
    "ARMATURE": "armature",
}


def config_text(robot: ConfigRobot) -> str:
    """Return the text of `genesis_config.py`."""
    spec = robot.spec
    config = source.fill(
        "genesis_config",
        about=source.docstring(_about(robot)),
        robot_urdf=source.path_assignment("ROBOT_URDF", spec.urdf),
        spawn_height=robot.provenance_comment("spawn_height", prefix="x, y, z"),
        height=source.float_literal(spec.spawn_height or 0.0),
        fixed=str(not spec.floating),
        bodies=_bodies(robot),
        joints=source.format_collection("JOINTS = ", source.format_strings(spec.joint_order)),
        tables=[
            line for name, field in _TABLES.items() for line in ("", *_table(robot, name, field))
        ],
        action_scale=robot.scale_table("ACTION_SCALE", "position"),
        speed_scale=robot.scale_table("SPEED_SCALE", "velocity"),
    )
    return source.join_lines([config])


def _about(robot: ConfigRobot) -> list[str]:
    package = package_name(robot.spec.name)
    return [
        f"{robot.title} for Genesis: entity, gains and default pose.",
        source.GENERATED_NOTE,
        f"Copy the folder into your Python package as {package}, and use",
        "\n".join(source.fill("genesis_use", package=package)),
        "Genesis has its own joint order: index DOFs by `dofs(robot)`, which follows the order of "
        "JOINTS.",
    ]


def _bodies(robot: ConfigRobot) -> list[str]:
    spec = robot.spec
    contacts = (*spec.penalized_contacts, *spec.termination_contacts)
    kept = dict.fromkeys([*spec.feet, *contacts])
    return [
        *source.format_collection("FEET = ", source.format_strings(spec.feet)),
        "# Bodies whose contacts are penalized.",
        *source.format_collection("PENALIZED = ", source.format_strings(spec.penalized_contacts)),
        "# Bodies whose ground contact terminates an episode.",
        *source.format_collection(
            "TERMINATION = ", source.format_strings(spec.termination_contacts)
        ),
        "# Bodies that are not merged into their parents.",
        *source.format_collection("LINKS_TO_KEEP = ", source.format_strings(kept)),
    ]


def _table(robot: ConfigRobot, name: str, field: str) -> list[str]:
    entries = source.dict_entries(robot.joint_values(field))
    lines = source.format_collection(f"{name} = ", entries, "{}")
    return [*robot.provenance_comment(field), *lines]
