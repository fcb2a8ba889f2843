"""Genesis: the entity of a robot, its gains and its pose."""

from collections.abc import Iterator

from terrainkit_robots.onboarding.frameworks.config_robot import ConfigRobot
from terrainkit_robots.onboarding.frameworks.naming import package_name
from terrainkit_robots.onboarding.frameworks.source import (
    HERE,
    WRITTEN,
    assign_sum,
    docstring,
    literal,
    module,
    number,
    spread,
    strings,
    table,
)

LEGGED_ONLY = False
"""Whether it takes robots with legs only."""

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
    """Add the robot to a scene that is not built yet, and return its entity."""
    return scene.add_entity(
        gs.morphs.URDF(
            file=str(ROBOT_URDF),
            pos=POSITION,
            fixed=FIXED,
            merge_fixed_links=True,
            links_to_keep=LINKS_TO_KEEP,
            # Rotors are ARMATURE; else Genesis gives 0.1 kg m2 to every joint.
            default_armature=None,
        )
    )


def dofs(robot, joints=JOINTS):
    """Return the degree of freedom of each joint, counted from the robot's first."""
    return [robot.get_joint(name).dofs_idx_local[0] for name in joints]


def configure(robot):
    """Give the robot its gains, limits and pose; its scene is built."""
    robot.set_dofs_kp(list(STIFFNESS.values()), dofs(robot, STIFFNESS))
    robot.set_dofs_kv(list(DAMPING.values()), dofs(robot, DAMPING))
    if EFFORT:
        most = list(EFFORT.values())
        robot.set_dofs_force_range([-each for each in most], most, dofs(robot, EFFORT))
    if ARMATURE:
        robot.set_dofs_armature(list(ARMATURE.values()), dofs(robot, ARMATURE))
    robot.set_dofs_position(list(DEFAULT_POSE.values()), dofs(robot, DEFAULT_POSE))
    if ACTION_SCALE:
        targets = [DEFAULT_POSE[name] for name in ACTION_SCALE]
        robot.control_dofs_position(targets, dofs(robot, ACTION_SCALE))
    if SPEED_SCALE:
        robot.control_dofs_velocity([0.0] * len(SPEED_SCALE), dofs(robot, SPEED_SCALE))


def build(scene, n_envs=0):
    """Add the robot to a scene, build that, and return the robot at its pose."""
    robot = add(scene)
    scene.build(n_envs=n_envs)
    configure(robot)
    return robot
'''
"""What can be done with the robot; the same for every one that has joints."""

_WITHOUT_JOINTS = '''
def configure(robot):
    """Do nothing: there are no joints to be driven."""
'''


def config_text(robot: ConfigRobot) -> str:
    """Return the file `genesis_config.py` of a robot."""
    spec = robot.spec
    height = number(spec.spawn_height or 0.0)
    return module(
        [
            docstring(_about(robot)),
            ["", "from pathlib import Path", "", "import genesis as gs", ""],
            [*assign_sum("ROBOT_URDF", HERE, "/", literal(spec.urdf)), ""],
            robot.origin("spawn_height", what="x, y, z"),
            [f"POSITION = (0.0, 0.0, {height})"],
            ["# Whether the base is bolted down.", f"FIXED = {not spec.floating}", ""],
            _bodies(robot),
            ["", "# The order of actions and observations."],
            spread("JOINTS = ", strings(spec.joint_order)),
            *(["", *_table(robot, name, field)] for name, field in _TABLES.items()),
            *_scales(robot),
            ["", *_functions(robot).rstrip().split("\n")],
        ]
    )


def _about(robot: ConfigRobot) -> list[str]:
    package = package_name(robot.spec.name)
    return [
        f"{robot.title} for Genesis: its entity, gains and pose.",
        WRITTEN,
        f"Put the whole folder into a package of yours, as {package}, and use",
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
        "Genesis orders joints in its own way: index them by `dofs(robot)`, which is in the order "
        "of JOINTS.",
    ]


def _bodies(robot: ConfigRobot) -> list[str]:
    spec = robot.spec
    contacts = (*spec.penalized_contacts, *spec.termination_contacts)
    kept = dict.fromkeys([*spec.feet, *contacts])
    return [
        *spread("FEET = ", strings(spec.feet)),
        "# Bodies whose contacts cost reward.",
        *spread("PENALIZED = ", strings(spec.penalized_contacts)),
        "# Bodies whose contact with the ground ends an episode.",
        *spread("TERMINATION = ", strings(spec.termination_contacts)),
        "# Bodies that are not to be merged into their parents.",
        *spread("LINKS_TO_KEEP = ", strings(kept)),
    ]


def _table(robot: ConfigRobot, name: str, field: str) -> list[str]:
    values = robot.of_every_joint(field) if field in _REQUIRED else robot.by_joint(field)
    return [*robot.origin(field), *spread(f"{name} = ", table(values), "{}")]


def _scales(robot: ConfigRobot) -> Iterator[list[str]]:
    """Yield what an action of 1 changes: a position, or the speed of what has no stiffness."""
    for name, joints, told, origin in (
        ("ACTION_SCALE", robot.position_joints, "position", robot.origin("action_scale")),
        ("SPEED_SCALE", robot.velocity_joints, "speed", robot.speed_origin()),
    ):
        yield ["", f"# Change of the {told} that a joint is told, for an action of 1.", *origin]
        yield spread(f"{name} = ", table(robot.scales(joints)), "{}")


def _functions(robot: ConfigRobot) -> str:
    if robot.spec.joint_order:
        return _FUNCTIONS
    start = _FUNCTIONS.index("\ndef dofs(")
    end = _FUNCTIONS.index("\ndef build(")
    return _FUNCTIONS[:start] + _WITHOUT_JOINTS + "\n" + _FUNCTIONS[end:]
