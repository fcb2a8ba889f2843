"""Onboarding: from the facts of a robot to the files of its folder, in memory.

What was read is brought into its normal form, its meshes are packed, gains and poses are suggested
where nobody gave them, and everything is written as text. Nothing here touches the disk.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from terrainkit.errors import ConfigError, ExportError
from terrainkit_robots.analysis.bodies.kinematics import body_poses
from terrainkit_robots.analysis.bodies.shapes import lowest
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.export.actuator import ActuatorConfig
from terrainkit_robots.export.canonical import to_canonical
from terrainkit_robots.export.fixed_joint_merge import merge_fixed_joints
from terrainkit_robots.export.mjcf import Extras, Site, mjcf_text, scene_text
from terrainkit_robots.export.sites import foot_sites, imu_notes, imu_site
from terrainkit_robots.mesh.mesh_cache import Meshes

if TYPE_CHECKING:
    from terrainkit_robots.description.model import RobotModel
    from terrainkit_robots.export.collision_simplification.simplify import How, Progress
    from terrainkit_robots.spec.robot_spec import RobotSpec

URDF, MJCF, SCENE, SPEC = "robot.urdf", "robot.xml", "scene.xml", "robot.toml"
"""What the files of a folder are called."""

_AT_REST = 1e-4
"""Shapes that are deeper than this inside each other at the standing pose push each other [m]."""

_DRIVEN = ("stiffness", "damping", "effort", "armature", "velocity")
"""What a motor takes from the spec."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Onboarded:
    """A robot that is ready to be written."""

    facts: Facts
    """The robot as it is written."""

    spec: "RobotSpec"

    files: Mapping[str, bytes]
    """Content of each file of the folder, by its name in it."""

    notes: tuple[str, ...]
    """What was left out, changed or made on the way, a sentence each."""


@dataclass(frozen=True, kw_only=True)
class Given:
    """A spec that somebody edited or measured, which goes before what would be suggested."""

    spec: "RobotSpec"

    file: str
    """Where it was read from."""


def onboard(
    source: Facts,
    *,
    collision: "How" = "keep",
    floating: bool | None = None,
    given: Given | None = None,
    cache: Path | None = None,
    progress: "Progress" = lambda items, _: items,
) -> Onboarded:
    """Return a robot's files: robot.toml, robot.urdf, robot.xml, scene.xml and its meshes.

    Args:
        source: The robot as it was read.
        collision: What becomes of its collision meshes.
        floating: Whether the base moves freely; unless told, as the spec that is given or the file
            says, or the legs suggest.
        given: Values that go before what would be suggested.
        cache: Folder that keeps convex parts from one run to the next.
        progress: Draws a bar while collision meshes are worked on.

    Raises:
        TerrainkitError: if there is no robot, a mesh of it cannot be had, the spec that is given is
            of another, or MuJoCo refuses it.
    """
    from terrainkit_robots.export.collision_simplification.simplify import simplify_collisions
    from terrainkit_robots.export.mesh_export.mesh_export import export_meshes
    from terrainkit_robots.export.unsupported import unsupported_elements
    from terrainkit_robots.export.urdf import urdf_text

    if floating is None and given is not None:
        floating = given.spec.floating
    form = to_canonical(source, floating=floating)
    treated = simplify_collisions(
        form.model, source.meshes, collision, cache=cache, progress=progress
    )
    packed = export_meshes(treated.model, treated.meshes)
    meshes = Meshes({Path(name): data for name, data in packed.files.items()})
    doubts = _doubts(Facts(packed.model, meshes, spec=given.spec), given) if given else ()
    spec = _spec(Facts(packed.model, meshes), given)
    facts = Facts(_with_motors(packed.model, spec), meshes, spec=spec)
    excluded, said = _excluded(facts)
    texts = {
        URDF: urdf_text(facts.model, feet=spec.feet),
        MJCF: _mjcf(facts, spec, excluded),
        SCENE: scene_text(facts.model.name, MJCF, height=max(_height(facts), 0.1)),
        SPEC: spec.to_toml(),
    }
    return Onboarded(
        facts=facts,
        spec=spec,
        files={name: text.encode() for name, text in texts.items()} | dict(packed.files),
        notes=(
            *doubts,
            *form.notes,
            *unsupported_elements(source.model),
            *treated.notes,
            *packed.notes,
            *said,
            *imu_notes(facts),
        ),
    )


def _spec(facts: Facts, given: Given | None) -> "RobotSpec":
    """Return the spec of a robot: what is given, or derived.

    Raises:
        ExportError: if no gains can be suggested, since the robot cannot be simulated.
    """
    from terrainkit_robots.onboarding.derive_spec.derive import derive_spec
    from terrainkit_robots.simulation.pd_gains import suggest_gains
    from terrainkit_robots.spec.provenance import with_provenance

    try:
        gains = suggest_gains(facts)
    except CannotCheckError as error:
        raise ExportError(f"{facts.model.file}: no gains can be suggested: {error}") from None
    floating = bool(facts.model.floating)
    derived = derive_spec(facts, gains=gains, floating=floating, urdf=URDF, mjcf=MJCF)
    if given is None:
        return derived
    mine = replace(given.spec, floating=floating, urdf=URDF, mjcf=MJCF)
    return with_provenance(mine, derived, given.file)


def _doubts(facts: Facts, given: Given) -> tuple[str, ...]:
    """Return what is odd about the spec that is given.

    Raises:
        ConfigError: if it is wrong for the robot.
    """
    from terrainkit_robots.lint.rule import rules
    from terrainkit_robots.lint.runner import lint

    others = set(given.spec.joint_order) - {joint.name for joint in facts.joints}
    if others == set(given.spec.joint_order) and others:
        raise ConfigError(
            f"{given.file} is of {given.spec.name}: none of its joints is in {facts.model.title}"
        )
    asked = [rule for rule in rules() if "spec" in rule.needs]
    found = lint(facts, asked).findings
    wrong = [finding for finding in found if finding.severity == "error"]
    if wrong:
        more = f" (and {len(wrong) - 1} more; check-robot --spec has all)" if wrong[1:] else ""
        raise ConfigError(f"{given.file}: {wrong[0].code}: {wrong[0].message}{more}")
    odd = (finding for finding in found if finding.severity == "warning")
    return tuple(f"{given.file}: {finding.code}: {finding.message}" for finding in odd)


def _with_motors(model: "RobotModel", spec: "RobotSpec") -> "RobotModel":
    """Return a robot whose joints have the efforts and speeds of its spec."""
    efforts, speeds = spec.per_joint("effort"), spec.per_joint("velocity")
    joints = tuple(
        replace(
            joint,
            limit=replace(joint.limit, effort=efforts[joint.name], velocity=speeds[joint.name]),
        )
        if joint.limit is not None and joint.name in efforts
        else joint
        for joint in model.joints
    )
    motors = (replace(motor, effort=efforts[motor.joint]) for motor in model.actuators)
    return replace(model, joints=joints, actuators=tuple(motors))


def _mjcf(facts: Facts, spec: "RobotSpec", excluded: frozenset[frozenset[str]]) -> str:
    """Return the robot as MJCF, in which pairs of links are not to touch."""
    single = merge_fixed_joints(replace(facts.model, excluded=excluded), keep=spec.feet)
    columns = {name: spec.per_joint(name) for name in _DRIVEN}
    drives = {
        joint: ActuatorConfig(**{name: values[joint] for name, values in columns.items()})
        for joint in spec.joint_order
    }
    bodies = {link.name for link in single.model.links}
    frames = [
        Site(name=link, body=body, pose=pose)
        for link, (body, pose) in single.frames.items()
        if link not in bodies
    ]
    imu = imu_site(facts)
    if imu.name in spec.feet:
        imu = replace(imu, name=f"{imu.name}_site")
    extras = Extras(
        actuators=drives,
        feet=foot_sites(facts, spec.feet),
        imu=imu,
        frames=tuple(frames),
        excluded=single.model.excluded,
        home=facts.positions,
        height=_height(facts),
        height_at_zero=max(_height(facts), _clearance(facts, {})) if facts.stance else None,
    )
    return mjcf_text(single.model, extras)


def _excluded(facts: Facts) -> tuple[frozenset[frozenset[str]], tuple[str, ...]]:
    """Return pairs of links that are not to touch, and what to say of them."""
    declared = facts.model.excluded
    try:
        found = facts.overlaps.overlaps(facts.positions)
    except CannotCheckError as error:
        return declared, (f"did not look for shapes inside each other: {error}",)
    pairs = {frozenset((o.first.link, o.second.link)): o.depth for o in found if o.depth > _AT_REST}
    notes = tuple(
        f"{' and '.join(sorted(pair))} do not touch each other in robot.xml: at the standing pose "
        f"they are {1000 * depth:.1f} mm inside each other"
        for pair, depth in pairs.items()
    )
    return declared | frozenset(pairs), notes


def _height(facts: Facts) -> float:
    """Return how high the base of a robot is that stands or lies on the ground [m]."""
    if not facts.model.floating and facts.bodies[0].virtual:
        return 0.0  # its base is the world
    if facts.stance is not None:
        return facts.stance.height
    if not facts.model.floating:
        return 0.0
    return max(0.0, _clearance(facts, facts.positions))


def _clearance(facts: Facts, positions: Mapping[str, float]) -> float:
    """Return how high the base is when the lowest shape touches the ground [m]."""
    poses = body_poses(facts.bodies, positions)
    depths = [
        lowest(shape, pose, facts.meshes)
        for body, pose in zip(facts.bodies, poses, strict=True)
        for shape in (*body.collisions, *body.visuals)
    ]
    return -min(depths, default=0.0)
