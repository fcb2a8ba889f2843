"""The files of an onboarded robot, computed in memory from the facts of its source."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from terrainkit.errors import ConfigError, ExportError
from terrainkit_robots.analysis.bodies.kinematics import body_poses
from terrainkit_robots.analysis.bodies.shapes import min_height
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.keyframe import keyframe_defect
from terrainkit_robots.analysis.legs.wheels import turns_without_limits
from terrainkit_robots.description.model import RobotModel
from terrainkit_robots.export.actuator import ActuatorConfig
from terrainkit_robots.export.canonical import to_canonical
from terrainkit_robots.export.collision_simplification.simplify import simplify_collisions
from terrainkit_robots.export.fixed_joint_merge import merge_fixed_joints
from terrainkit_robots.export.mesh_export.mesh_export import export_meshes
from terrainkit_robots.export.mjcf import Extras, Site, mjcf_text, scene_text
from terrainkit_robots.export.sites import foot_sites, imu_changes, imu_site
from terrainkit_robots.export.unsupported import unsupported_elements
from terrainkit_robots.export.urdf import urdf_text
from terrainkit_robots.lint.rule import rules
from terrainkit_robots.lint.runner import Report, lint
from terrainkit_robots.mesh.mesh_cache import Meshes
from terrainkit_robots.onboarding.derive_spec.derive import derive_spec
from terrainkit_robots.onboarding.onboard_options import OnboardOptions
from terrainkit_robots.onboarding.repair import without_placeholder_efforts
from terrainkit_robots.onboarding.source_model import with_compiled_gains
from terrainkit_robots.simulation.declared_gains import standing_gains
from terrainkit_robots.simulation.gain import GainSet
from terrainkit_robots.simulation.pd_gains import suggest_training_gains
from terrainkit_robots.spec.column import rounded_length
from terrainkit_robots.spec.provenance import with_provenance
from terrainkit_robots.spec.robot_arrays import SPEC_FILE
from terrainkit_robots.spec.robot_spec import RobotSpec
from terrainkit_robots.text import names

URDF, MJCF, SCENE = "robot.urdf", "robot.xml", "scene.xml"
"""Names of the files in the folder, besides SPEC_FILE."""

_MAX_PENETRATION = 1e-4
"""Links that penetrate each other by more than this at the default pose do not collide [m]."""

_ACTUATOR_FIELDS = ("stiffness", "damping", "effort", "armature", "velocity")
"""Fields of the spec that define an actuator."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RobotFiles:
    """A robot that is ready to be written."""

    facts: Facts
    """Facts of the robot as it is written."""

    spec: RobotSpec
    """Its spec, as in robot.toml."""

    files: Mapping[str, bytes]
    """Content of each file, by its name in the folder."""

    changes: tuple[str, ...]
    """What was omitted, changed or added, one sentence each."""


def convert(
    report: Report, options: OnboardOptions, user_spec: RobotSpec | None = None
) -> RobotFiles:
    """Return the files of a robot: robot.toml, robot.urdf, robot.xml, scene.xml and meshes.

    Args:
        report: The report on the source file.
        options: How it is converted.
        user_spec: The spec of `options.spec`, with measured or edited values that replace the
            derived values.

    Raises:
        TerrainkitError: if the file contains no robot, a mesh cannot be read, the overriding spec
            belongs to another robot, or MuJoCo rejects the robot.
    """
    source, effort_changes = without_placeholder_efforts(report)
    if source.model.kind == "mjcf":
        source = with_compiled_gains(source)
    name, floating = options.name, options.floating
    if floating is None and user_spec is not None:
        floating = user_spec.floating
    canonical = to_canonical(source, floating=floating)
    simplified = simplify_collisions(
        canonical.model,
        source.meshes,
        options.collision,
        cache=options.cache_dir,
        progress=options.progress,
    )
    exported = export_meshes(simplified.model, simplified.meshes)
    meshes = Meshes({Path(name): data for name, data in exported.files.items()})
    model = exported.model
    spec_changes: tuple[str, ...] = ()
    if user_spec is not None:
        spec_changes = _check_user_spec(Facts(model, meshes, spec=user_spec), str(options.spec))
    # Gains and limits are derived from the robot that is written, with its meshes.
    spec = _derived_spec(Facts(model, meshes), options.gains)
    if set(source.actuator_order) == set(spec.joint_order) and source.model.kind != "mjcf":
        spec = replace(spec, joint_order=source.actuator_order)  # of a spec with only loops
    if user_spec is not None:
        own = replace(user_spec, floating=spec.floating, urdf=URDF, mjcf=MJCF, loops=spec.loops)
        spec = with_provenance(own, spec, str(options.spec))
    if name:
        model, spec = replace(model, name=name), replace(spec, name=name)
    facts = Facts(_set_motor_limits(model, spec), meshes, spec=spec)
    excluded, contact_changes = _excluded_contacts(facts)
    texts = {
        URDF: urdf_text(facts.model, feet=spec.feet),
        MJCF: _mjcf_text(facts, spec, excluded),
        SCENE: scene_text(
            facts.model.name, MJCF, height=max(rounded_length(_base_height(facts)), 0.1)
        ),
        SPEC_FILE: spec.to_toml(),
    }
    return RobotFiles(
        facts=facts,
        spec=spec,
        files={name: text.encode() for name, text in texts.items()} | dict(exported.files),
        changes=(
            *spec_changes,
            *canonical.changes,
            *unsupported_elements(source.model),
            *simplified.changes,
            *exported.changes,
            *contact_changes,
            *imu_changes(facts),
            *_held_joints(facts, spec),
            *_replaced_ranges(source.model),
            *(_keyframe_changes(facts) if user_spec is None else ()),
            *(effort_changes if user_spec is None else ()),
        ),
    )


def _derived_spec(facts: Facts, gain_set: GainSet) -> RobotSpec:
    """Return the derived spec.

    Raises:
        ExportError: if the robot cannot be simulated, so that no gains can be derived.
    """
    try:
        gains = standing_gains(facts) if gain_set == "stand" else suggest_training_gains(facts)
    except CannotCheckError as error:
        raise ExportError(f"{facts.model.file}: cannot derive PD gains: {error}") from None
    floating = bool(facts.model.floating)
    return derive_spec(facts, gains=gains, floating=floating, urdf=URDF, mjcf=MJCF)


def _check_user_spec(facts: Facts, file: str) -> tuple[str, ...]:
    """Return the warnings of the lint rules for the overriding spec.

    Args:
        facts: The robot and the spec.
        file: The file of the spec.

    Raises:
        ConfigError: if the spec does not fit the robot.
    """
    spec = facts.required_spec
    joints = set(spec.joint_order)
    if joints and joints.isdisjoint(joint.name for joint in facts.joints):
        raise ConfigError(
            f"{file} belongs to {spec.name}: none of its joints is in {facts.model.title}"
        )
    findings = lint(facts, [rule for rule in rules() if "spec" in rule.needs]).findings
    errors = [finding for finding in findings if finding.severity == "error"]
    if errors:
        more = f" (and {len(errors) - 1} more; see check-robot --spec)" if errors[1:] else ""
        raise ConfigError(f"{file}: {errors[0].code}: {errors[0].message}{more}")
    warnings = (finding for finding in findings if finding.severity == "warning")
    return tuple(f"{file}: {finding.code}: {finding.message}" for finding in warnings)


def _set_motor_limits(model: RobotModel, spec: RobotSpec) -> RobotModel:
    """Return a model whose joints have the effort and velocity limits of the spec.

    Damping of a joint that is its derivative gain in the spec is removed from the joint.
    """
    effort, velocity = spec.per_joint("effort"), spec.per_joint("velocity")
    damping = spec.per_joint("damping")
    joints = tuple(
        replace(
            joint,
            dynamics=replace(joint.dynamics, damping=None)
            if joint.dynamics is not None
            and joint.position_gains is not None
            and joint.position_gains.damping is None
            and joint.damping == damping[joint.name]
            else joint.dynamics,
            limit=replace(joint.limit, effort=effort[joint.name], velocity=velocity[joint.name]),
        )
        if joint.limit is not None and joint.name in effort
        else joint
        for joint in model.joints
    )
    actuators = (replace(actuator, effort=effort[actuator.joint]) for actuator in model.actuators)
    return replace(model, joints=joints, actuators=tuple(actuators))


def _mjcf_text(facts: Facts, spec: RobotSpec, excluded: frozenset[frozenset[str]]) -> str:
    """Return robot.xml, in which pairs of links are excluded from contact."""
    merged = merge_fixed_joints(replace(facts.model, excluded=excluded), keep=spec.feet)
    columns = {name: spec.per_joint(name) for name in _ACTUATOR_FIELDS}
    actuators = {
        joint: ActuatorConfig(**{name: values[joint] for name, values in columns.items()})
        for joint in spec.joint_order
    }
    # Links that were merged into others remain as sites, so that their frames can be found.
    bodies = {link.name for link in merged.model.links}
    frames = [
        Site(name=link, body=body, pose=pose)
        for link, (body, pose) in merged.frames.items()
        if link not in bodies
    ]
    imu = imu_site(facts)
    is_other = any(
        frame.name == imu.name
        and not (frame.body == imu.body and np.allclose(frame.pose, imu.pose))
        for frame in frames
    )
    if imu.name in spec.feet or is_other:
        imu = replace(imu, name=f"{imu.name}_site")
    # At position 0 the legs are often straight. The base is then higher, or the feet would be in
    # the ground.
    height = rounded_length(_base_height(facts))
    extras = Extras(
        actuators=actuators,
        feet=foot_sites(facts, spec.feet),
        imu=imu,
        frames=tuple(frames),
        keyframe=facts.default_pose,
        height=height,
        height_at_zero=max(height, rounded_length(_clearance(facts, {}))) if facts.stance else None,
    )
    return mjcf_text(merged.model, extras)


def _keyframe_changes(facts: Facts) -> Iterator[str]:
    """Yield one line if the first keyframe is not the default pose."""
    if defect := keyframe_defect(facts):
        yield (
            "the first keyframe is not the default pose: its feet do not carry the robot "
            f"({defect}); a standing pose was solved instead"
        )


def _replaced_ranges(model: RobotModel) -> Iterator[str]:
    """Yield one line if targets of the source differ from the limits of their joints."""
    limits = {joint.name: joint.range for joint in model.joints}
    found = [
        f"{motor.joint} ({motor.targets[0]:.4g} to {motor.targets[1]:.4g})"
        for motor in model.actuators
        if motor.targets and (own := limits.get(motor.joint))
        if not np.allclose(motor.targets, own, atol=1e-3)
    ]
    if found:
        yield f"the limits of the joints replace the ctrlrange of {names(found, max_count=4)}"


def _held_joints(facts: Facts, spec: RobotSpec) -> Iterator[str]:
    """Yield one line if the last joints of legs turn without limits, but are held."""
    stiffness = spec.per_joint("stiffness")
    ends = [leg.joints[-1] for leg in facts.legs if not leg.limb.has_wheel]
    held = [j.name for j in ends if turns_without_limits(j) and stiffness.get(j.name, 0.0) > 0]
    if held:
        gains = names(f"{gain:g}" for gain in dict.fromkeys(stiffness[name] for name in held))
        yield (
            f"{names(held, max_count=4)} turn without limits, but are held as ankles by a "
            f"stiffness of {gains} N m/rad: their collision shapes are not round about their axes, "
            "as wheels are"
        )


def _excluded_contacts(facts: Facts) -> tuple[frozenset[frozenset[str]], tuple[str, ...]]:
    """Return the pairs of links that must not collide, and a line for each derived pair."""
    # Coarse shapes overlap in the pose in which the robot stands. MuJoCo would push them apart.
    from_file = facts.model.excluded
    try:
        overlaps = facts.overlap_scene.detect(facts.default_pose)
    except CannotCheckError as error:
        return from_file, (f"links that penetrate each other were not searched for: {error}",)
    pairs = {
        frozenset((overlap.first.link, overlap.second.link)): overlap.depth
        for overlap in overlaps
        if overlap.depth > _MAX_PENETRATION
    }
    changes = tuple(
        f"{' and '.join(sorted(pair))} do not collide in robot.xml: they penetrate each other by "
        f"{1000 * depth:.1f} mm at the default pose"
        for pair, depth in pairs.items()
    )
    return from_file | frozenset(pairs), changes


def _base_height(facts: Facts) -> float:
    """Return the height of the base when the robot stands or lies on the ground [m]."""
    if not facts.model.floating and facts.bodies[0].virtual:
        return 0.0  # the base is the world
    if facts.stance is not None:
        return facts.stance.height
    if not facts.model.floating:
        return 0.0
    return max(0.0, _clearance(facts, facts.default_pose))


def _clearance(facts: Facts, positions: Mapping[str, float]) -> float:
    """Return the height of the base at which the lowest shape touches the ground [m]."""
    poses = body_poses(facts.bodies, positions)
    heights = [
        min_height(shape, pose, facts.meshes)
        for body, pose in zip(facts.bodies, poses, strict=True)
        for shape in (*body.collisions, *body.visuals)
    ]
    return -min(heights, default=0.0)
