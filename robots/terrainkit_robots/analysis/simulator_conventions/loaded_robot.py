"""Describe what each simulator makes of a file: mass, bodies, feet and what is lost.

The settings are the default ones; for Isaac Gym the settings of legged_gym. The tests compare
MuJoCo with its compiler; PyBullet was compared with pybullet 3.2.7.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from terrainkit_robots.analysis.facts import Facts, cached_fact
from terrainkit_robots.analysis.inertia.density import default_mass
from terrainkit_robots.analysis.inertia.physical import MIN_INERTIA
from terrainkit_robots.analysis.simulator_conventions.armature import GENESIS_ARMATURE
from terrainkit_robots.analysis.simulator_conventions.fixed_joints import merged_tree
from terrainkit_robots.analysis.simulator_conventions.joint_order import SimulatorOrder
from terrainkit_robots.description.model import WORLD, Link, RobotModel

_BULLET_MASS = 1.0
"""Mass that PyBullet gives to a link without <inertial> [kg]; 0 if it is called `world`."""


@dataclass(frozen=True, kw_only=True)
class LoadedRobot:
    """A robot as one simulator loads it."""

    order: SimulatorOrder
    """The simulator, and its order of joints and bodies."""

    mass: float
    """Mass of its bodies [kg]; NaN if MuJoCo computes one of them from a mesh."""

    bodies: tuple[str, ...]
    """Its bodies, without the world."""

    merged: Mapping[str, str]
    """Body or `world` that each merged link is a part of, by name of the link."""

    feet: tuple[str, ...]
    """Feet that are bodies of their own."""

    losses: tuple[str, ...]
    """What is lost or replaced, each as a clause."""


def is_welded(robot: Facts) -> bool:
    """Return whether MuJoCo welds the trunk of a URDF to the world: it has no floating joint."""
    floating = any(joint.kind in ("floating", "planar") for joint in robot.model.joints)
    return robot.model.kind != "mjcf" and not floating


def dropped_mass(robot: Facts) -> float:
    """Return the mass that MuJoCo drops when it loads an unmodified URDF [kg].

    MuJoCo welds the trunk to the world and drops its mass, unless the file has a floating joint
    above it or sets `fusestatic="false"`.
    """
    is_dropped = is_welded(robot) and robot.bodies and not robot.model.keeps_fixed_links
    return robot.bodies[0].mass if is_dropped else 0.0


@cached_fact
def loaded_robots(robot: Facts) -> tuple[LoadedRobot, ...]:
    """Return the robot as each simulator loads it."""
    return tuple(_loaded(robot, order) for order in robot.simulator_orders if robot.bodies)


def _loaded(robot: Facts, order: SimulatorOrder) -> LoadedRobot:
    model, simulator = robot.model, order.simulator
    body_of = merged_tree(robot, simulator).body_of
    merged = {link: body for link, body in body_of.items() if link != body}
    bodies = order.bodies
    mass = robot.total_mass
    losses = list[str]()
    bare = [link for link in robot.links if link.inertial is None and model.kind != "mjcf"]
    if simulator == "PyBullet":
        bare = [link for link in bare if link.name != WORLD]
        mass += _BULLET_MASS * len(bare)
        losses += _bullet_losses(model, bare)
    elif simulator == "MuJoCo":
        # The trunk of a welded robot is a part of the world, with everything fixed to it.
        is_static = is_welded(robot) and not model.keeps_fixed_links
        static = {link.name for link in robot.bodies[0].links} if is_static else set()
        bodies = tuple(name for name in bodies if name not in static)
        merged |= dict.fromkeys(static, WORLD)
        inferred = (default_mass(link, robot.meshes) for link in bare if link.name not in static)
        mass += sum(inferred) - dropped_mass(robot)
        losses += _mujoco_losses(robot)
    elif simulator == "Genesis" and any(joint.armature == 0 for joint in robot.joints):
        losses.append(f"joints without armature get {GENESIS_ARMATURE:g} kg m2")
    feet = tuple(leg.foot for leg in robot.legs if leg.foot not in merged)
    return LoadedRobot(
        order=order, mass=mass, bodies=bodies, merged=merged, feet=feet, losses=tuple(losses)
    )


def _mujoco_losses(robot: Facts) -> Iterator[str]:
    if is_welded(robot):
        mass = dropped_mass(robot)
        drops = f", which drops its {mass:.4g} kg" if mass > MIN_INERTIA else ""
        yield f"{robot.bodies[0].name} is welded to the world{drops}"
    if any(joint.velocity for joint in robot.model.joints):
        yield "velocity limits are not read"


def _bullet_losses(model: RobotModel, bare: Sequence[Link]) -> Iterator[str]:
    if any(joint.kind == "floating" for joint in model.joints):
        yield "floating joints become fixed joints"
    if bare:
        yield f"links without <inertial> get {_BULLET_MASS:g} kg each ({len(bare)})"
    yield "inertias are computed from the collision shapes by default"
