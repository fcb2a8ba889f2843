"""Rules on the conventions of simulators: joint order, merged feet and armature."""

from collections.abc import Sequence

from terrainkit_robots.analysis.bodies.permutation import permutation
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.simulator_conventions.armature import (
    GENESIS_ARMATURE,
    inertia_without_armature,
)
from terrainkit_robots.analysis.simulator_conventions.fixed_joints import (
    KEEP_LINK_OPTIONS,
    SIMULATORS,
)
from terrainkit_robots.analysis.simulator_conventions.joint_order import SimulatorOrder
from terrainkit_robots.analysis.simulator_conventions.loaded_robot import (
    dropped_mass,
    is_welded,
    loaded_robots,
)
from terrainkit_robots.lint.rule import UNITS, Part, Violation, Violations, rule
from terrainkit_robots.text import conjunction

_MAX_JOINTS = 40
"""Maximum number of joints for which the message contains the permutation."""


@rule("SIM001", "joint-order", "note")
def joint_order(robot: Facts) -> Violations:
    """A simulator orders the joints differently from the file.

    The observations and actions of a policy are ordered by joint. A policy that was trained in one
    simulator fails in another one, or on the real robot, unless they are reordered. Isaac Lab
    traverses the tree breadth-first, the other simulators depth-first.

    Fix:
        Address joints by name, or reorder by the printed list: `there = [here[i] for i in order]`,
        where `here` is in the order of the file. The JSON report contains all orders under
        `joint_orders`.

    Source:
        Compared with MuJoCo's compiler, genesis-world 1.4.5, Isaac Sim's URDF importer, and
        published joint lists for Isaac Lab and Isaac Gym. An order that these do not confirm is
        marked as unverified.
    """
    file = robot.file_order
    others = [order for order in robot.simulator_orders if order.joints != file]
    if not others:
        return
    same = [order.simulator for order in robot.simulator_orders if order not in others]
    orders = "; ".join(_format_order(order, file) for order in others)
    rest = f"; {conjunction(same)}: same as the file" if same else ""
    yield Violation(
        message=f"joint order, as indices into the file's order: {orders}{rest}",
        certainty="proven" if all(order.certain for order in others) else "likely",
        measured={"joints": len(file)},
    )


def _format_order(order: SimulatorOrder, file: Sequence[str]) -> str:
    unverified = "" if order.certain else " (unverified)"
    indices = permutation(file, order.joints)
    if indices is None:
        raise CannotCheckError("two joints have the same name")
    if len(indices) > _MAX_JOINTS:
        return f"{order.simulator}{unverified}: different ({len(indices)} joints)"
    return f"{order.simulator}{unverified}: {indices}"


@rule("SIM002", "merged-feet", "note", needs=("legs",))
def merged_feet(robot: Facts) -> Violations:
    """A simulator merges the feet into the shanks by default.

    A foot on a fixed joint is then not a separate body: its name does not exist, and contact forces
    are reported for the shank. Each simulator has its own option to keep it.

    Fix:
        MuJoCo: `<mujoco><compiler fusestatic="false"/></mujoco>` in the URDF. Isaac Gym and Isaac
        Lab: `dont_collapse="true"` on the fixed joint. Genesis: name the feet in `links_to_keep` of
        `gs.morphs.URDF`.

    Source:
        MuJoCo's `fusestatic`, which is enabled for URDF; legged_gym's `collapse_fixed_joints`;
        Isaac Lab's `merge_fixed_joints`; `merge_fixed_links` of genesis-world 1.4.5.
    """
    loaded = loaded_robots(robot)
    feet = {
        leg.foot: {r.order.simulator: r.merged[leg.foot] for r in loaded if leg.foot in r.merged}
        for leg in robot.legs
        if robot.tree.links[leg.foot].collisions
    }
    merges = {foot: bodies for foot, bodies in feet.items() if bodies}
    if not merges:
        return
    foot, bodies = next(iter(merges.items()))
    by = [name for name in SIMULATORS if any(name in simulators for simulators in merges.values())]
    more = ", ..." if len(merges) > 1 else ""
    verb = "merges" if len(by) == 1 else "merge"
    yield Violation(
        element=Part(foot, robot.tree.parent_joint[foot].source),
        message=f"{conjunction(by)} {verb} {len(merges)} feet into their parent links by default "
        f"({foot} into {next(iter(bodies.values()))}{more})",
        hint="; ".join(f"{simulator}: {KEEP_LINK_OPTIONS[simulator]}" for simulator in by),
        measured={"feet": len(merges)},
    )


@rule("SIM006", "welded-trunk", "note", needs=("legs",))
def welded_trunk(robot: Facts) -> Violations:
    """MuJoCo welds the trunk of a URDF to the world and drops its mass.

    A URDF has no free joint, and MuJoCo merges a root link without joint into the world: the robot
    cannot move, and its mass is too small. Other simulators make the base floating by an option.

    Fix:
        Convert the file to MJCF with a <freejoint/> in the trunk, as `terrainkit onboard` does. For
        MuJoCo alone, an empty link `world` and a joint of type floating above the trunk have the
        same effect; PyBullet turns such a joint into a fixed one.

    Source:
        Compared with MuJoCo 4.0. With `fusestatic="false"` the mass is kept, but the trunk does not
        move either.
    """
    trunk = robot.bodies[0]
    loaded = next((r for r in loaded_robots(robot) if r.order.simulator == "MuJoCo"), None)
    if loaded is None or not is_welded(robot):
        return
    dropped = dropped_mass(robot)
    drops = (
        f" and drops its mass: {loaded.mass:.4g} of {loaded.mass + dropped:.4g} kg are left in "
        f"{len(loaded.bodies)} bodies"
        if dropped > 0
        else ""
    )
    yield Violation(
        element=trunk.main_link,
        message=f"MuJoCo welds {trunk.name} to the world{drops}; expected a floating base",
        measured={"dropped": dropped, "left": loaded.mass},
    )


@rule("SIM003", "genesis-armature", "note", needs=UNITS)
def genesis_armature(robot: Facts) -> Violations:
    """The default armature of Genesis exceeds the inertia that a joint moves.

    Genesis sets the armature of a joint without one to 0.1 kg m2, ten times the armature of a small
    legged robot. The joint accelerates much more slowly than in other simulators, and a policy
    trained with it does not transfer.

    Fix:
        Set `default_armature` of gs.morphs.URDF or gs.morphs.MJCF to your motor's armature: rotor
        inertia times the square of the gear ratio.

    Source:
        `default_armature` in genesis-world 1.4.5 is 0.1 unless MuJoCo compatibility is enabled. It
        is compared with the inertia about the joint axis of all links below, at joint positions 0.
    """
    moved = inertia_without_armature(robot.bodies, robot.actuated)
    slowed = [inertia for inertia in moved.values() if inertia < GENESIS_ARMATURE]
    if not slowed:
        return
    joint = min(moved, key=moved.__getitem__)
    unit = joint.units.inertia
    yield Violation(
        element=joint,
        message=f"default armature of Genesis: {GENESIS_ARMATURE} {unit} exceeds the moved inertia "
        f"of {len(slowed)} of {len(robot.actuated)} joints; smallest: {joint.name} with "
        f"{moved[joint]:.2g} {unit}",
        measured={"inertia": moved[joint], "joints": len(slowed)},
    )
