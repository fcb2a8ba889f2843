"""Rule on what simulators make of the robot with their default options."""

from collections.abc import Iterator, Sequence

from terrainkit_robots.analysis.bodies.permutation import permutation
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.simulator_conventions.armature import (
    GENESIS_ARMATURE,
    inertia_without_armature,
)
from terrainkit_robots.analysis.simulator_conventions.fixed_joints import SIMULATORS
from terrainkit_robots.analysis.simulator_conventions.joint_order import SimulatorOrder
from terrainkit_robots.analysis.simulator_conventions.loaded_robot import (
    dropped_mass,
    is_welded,
    loaded_robots,
)
from terrainkit_robots.lint.rule import Violation, Violations, findings_of, rule
from terrainkit_robots.lint.rules.jnt.joint_limits import joints_without_zero
from terrainkit_robots.text import conjunction, names

_MAX_JOINTS = 40
"""Maximum number of joints for which the message contains the permutation."""


@rule("SIM001", "simulator-defaults", "note")
def simulator_defaults(robot: Facts) -> Violations:
    """A simulator changes the robot with its default options.

    - **Joint order.** The observations and actions of a policy are ordered by joint. A policy that
      was trained in one simulator fails in another one, or on the real robot, unless they are
      reordered. Isaac Lab traverses the tree breadth-first, the other simulators depth-first.
    - **Merged feet.** A foot on a fixed joint becomes a part of the shank: its name does not exist,
      and contact forces are reported for the shank.
    - **Welded trunk.** A URDF has no free joint, and MuJoCo merges a root link without joint into
      the world: the robot cannot move, and its mass is too small. Other simulators make the base
      floating by an option.
    - **Armature.** Genesis sets the armature of a joint without one to 0.1 kg m2, ten times the
      armature of a small legged robot. A joint that moves less inertia accelerates much more
      slowly than in other simulators.
    - **Start.** All joints start at 0, which the knees of most legs exclude: set the default
      positions. JNT012 reports robots without legs.

    Fix:
        Address joints by name, or reorder by the printed list: `there = [here[i] for i in order]`,
        where `here` is in the order of the file; the JSON report has all orders. Keep feet by
        `<mujoco><compiler fusestatic="false"/></mujoco>` in the URDF (MuJoCo),
        `dont_collapse="true"` on the fixed joint (Isaac Gym, Isaac Lab) or `links_to_keep` of
        gs.morphs.URDF (Genesis), whose `default_armature` is that of your motor. `terrainkit
        onboard` writes an MJCF with a free joint.

    Source:
        Compared with MuJoCo's compiler, genesis-world 1.4.5, Isaac Sim's URDF importer, and
        published joint lists for Isaac Lab and Isaac Gym. An order that these do not confirm is
        marked as unverified. Inertias are those of all links below a joint, all joints at 0.
    """
    file = robot.file_order
    others = [order for order in robot.simulator_orders if order.joints != file]
    parts = [*_order(others, file), *_feet(robot), *_trunk(robot)]
    if not any(findings_of(robot, "UNI001", "UNI002", "UNI003")):  # else, inertias say nothing
        parts += _armature(robot)
    if robot.legs and (joints := joints_without_zero(robot)):
        listed = names((joint.name for joint in joints), 4)
        parts.append(f"joints start at 0, which is outside of the limits of {listed}")
    if parts:
        yield Violation(
            message="; ".join(parts),
            certainty="proven" if all(order.certain for order in others) else "likely",
            measured={"joints": len(file)},
        )


def _order(others: Sequence[SimulatorOrder], file: Sequence[str]) -> Iterator[str]:
    """Yield how simulators with another order than the file order the joints."""
    if others:
        orders = "; ".join(_format_order(order, file) for order in others)
        yield f"joint order, as indices into the file's order: {orders}"


def _format_order(order: SimulatorOrder, file: Sequence[str]) -> str:
    unverified = "" if order.certain else " (unverified)"
    indices = permutation(file, order.joints)
    if indices is None:
        raise CannotCheckError("two joints have the same name")
    if len(indices) > _MAX_JOINTS:
        return f"{order.simulator}{unverified}: different ({len(indices)} joints)"
    return f"{order.simulator}{unverified}: {indices}"


def _feet(robot: Facts) -> Iterator[str]:
    """Yield which simulators merge feet that have collision shapes."""
    loaded = loaded_robots(robot)
    feet = {leg.foot for leg in robot.legs if robot.tree.links[leg.foot].collisions}
    merged = {r.order.simulator: sorted(feet & r.merged.keys()) for r in loaded}
    by = [name for name in SIMULATORS if merged.get(name)]
    if by:
        verb = "merges" if len(by) == 1 else "merge"
        foot = merged[by[0]][0]
        body = next(r.merged[foot] for r in loaded if r.order.simulator == by[0])
        yield (
            f"{conjunction(by)} {verb} {max(map(len, merged.values()))} feet into their parent "
            f"links, such as {foot} into {body}"
        )


def _trunk(robot: Facts) -> Iterator[str]:
    """Yield that MuJoCo welds the trunk of a legged URDF to the world."""
    loaded = next((r for r in loaded_robots(robot) if r.order.simulator == "MuJoCo"), None)
    if robot.legs and loaded is not None and is_welded(robot):
        dropped = dropped_mass(robot)
        drops = f" and drops {dropped:.4g} of {loaded.mass + dropped:.4g} kg" if dropped > 0 else ""
        yield f"MuJoCo welds {robot.bodies[0].name} to the world{drops}"


def _armature(robot: Facts) -> Iterator[str]:
    """Yield that the armature of Genesis is larger than the inertia that joints move."""
    moved = inertia_without_armature(robot)
    slowed = [inertia for inertia in moved.values() if inertia < GENESIS_ARMATURE]
    if slowed:
        joint = min(moved, key=moved.__getitem__)
        unit = joint.units.inertia
        yield (
            f"the armature of Genesis, {GENESIS_ARMATURE} {unit}, exceeds the inertia that "
            f"{len(slowed)} of {len(robot.actuated)} joints move, such as {moved[joint]:.2g} "
            f"{unit} of {joint.name}"
        )
