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

_REQUIRED = ("default_pose", "stiffness", "damping")

_FUNCTIONS = '''
def add(scene):
    """Add the robot to a scene before it is built, and return its entity."""
    return scene.add_entity(
        gs.morphs.URDF(
            file=str(ROBOT_URDF),
            pos=POSITION,
            fixed=FIXED,
            merge_fixed_links=True,
            links_to_keep=LINKS_TO_KEEP,
            # Set by ARMATURE below; Genesis' default for all joints is 0.1 kg m2.
            default_armature=None,
        )
    )


def dofs(robot, joints=JOINTS):
    """Return the local DOF index of each joint."""
    return [robot.get_joint(name).dofs_idx_local[0] for name in joints]


def configure(robot):
    """Set gains, limits and pose of the robot after its scene is built."""
    if not JOINTS:
        return
    robot.set_dofs_kp(list(STIFFNESS.values()), dofs(robot, STIFFNESS))
    robot.set_dofs_kv(list(DAMPING.values()), dofs(robot, DAMPING))
    if EFFORT:
        limits = list(EFFORT.values())
        robot.set_dofs_force_range([-x for x in limits], limits, dofs(robot, EFFORT))
    if ARMATURE:
        robot.set_dofs_armature(list(ARMATURE.values()), dofs(robot, ARMATURE))
    robot.set_dofs_position(list(DEFAULT_POSE.values()), dofs(robot, DEFAULT_POSE))
    if ACTION_SCALE:
        targets = [DEFAULT_POSE[name] for name in ACTION_SCALE]
        robot.control_dofs_position(targets, dofs(robot, ACTION_SCALE))
    if SPEED_SCALE:
        robot.control_dofs_velocity([0.0] * len(SPEED_SCALE), dofs(robot, SPEED_SCALE))


def build(scene, n_envs=0):
    """Add the robot to a scene, build the scene, and return the configured robot."""
    robot = add(scene)
    scene.build(n_envs=n_envs)
    configure(robot)
    return robot
'''
"""The functions of the configuration, the same for every robot."""


def config_text(robot: ConfigRobot) -> str:
    """Return the text of `genesis_config.py`."""
    spec = robot.spec
    height = source.float_literal(spec.spawn_height or 0.0)
    return source.join_lines(
        [
            source.docstring(_about(robot)),
            ["", "from pathlib import Path", "", "import genesis as gs", ""],
            [
                *source.sum_assignment(
                    "ROBOT_URDF", source.PARENT_FOLDER, "/", source.string_literal(spec.urdf)
                ),
                "",
            ],
            robot.provenance_comment("spawn_height", prefix="x, y, z"),
            [f"POSITION = (0.0, 0.0, {height})"],
            ["# Whether the base is fixed to the world.", f"FIXED = {not spec.floating}", ""],
            _bodies(robot),
            ["", "# The order of actions and observations."],
            source.format_collection("JOINTS = ", source.format_strings(spec.joint_order)),
            *(["", *_table(robot, name, field)] for name, field in _TABLES.items()),
            robot.scale_table("ACTION_SCALE", "position"),
            robot.scale_table("SPEED_SCALE", "velocity"),
            ["", *_FUNCTIONS.rstrip().split("\n")],
        ]
    )


def _about(robot: ConfigRobot) -> list[str]:
    package = package_name(robot.spec.name)
    return [
        f"{robot.title} for Genesis: entity, gains and default pose.",
        source.GENERATED_NOTE,
        f"Copy the folder into your Python package as {package}, and use",
        "\n".join(
            [
                "    import genesis as gs",
                f"    from {package}.genesis_config import build",
                "",
                "    gs.init()",
                "    scene = gs.Scene()",
                "    scene.add_entity(gs.morphs.Plane())",
                "    robot = build(scene, n_envs=4096)",
            ]
        ),
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
    values = robot.all_joint_values(field) if field in _REQUIRED else robot.joint_values(field)
    lines = source.format_collection(f"{name} = ", source.dict_entries(values), "{}")
    return [*robot.provenance_comment(field), *lines]
