"""Verify an onboarded robot: its files match the source, and it stands in simulation."""

from collections.abc import Collection, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import mujoco

from terrainkit.errors import ExportError, one_line
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.stance import is_statically_stable
from terrainkit_robots.export.ball_joints import with_hinges_for_balls
from terrainkit_robots.onboarding.comparison import Comparison, compare_models
from terrainkit_robots.onboarding.convert import MJCF, SCENE, URDF, RobotFiles
from terrainkit_robots.onboarding.source_model import described_model, load_source
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.simulation.assessment import assess
from terrainkit_robots.simulation.gain import Gain
from terrainkit_robots.simulation.pd_gains import suggest_gains
from terrainkit_robots.simulation.sim_model import SimModel
from terrainkit_robots.simulation.standing import (
    StandResult,
    contact_areas,
    ground_normal,
    stand_test,
    why_it_balances,
)
from terrainkit_robots.simulation.step_response import StepResponse, step_responses
from terrainkit_robots.simulation.written_model import remove_drawings
from terrainkit_robots.spec.robot_spec import RobotSpec

_DURATION = 5.0
"""Duration of the standing test [s]."""


@dataclass(frozen=True, kw_only=True)
class Verification:
    """The result of verifying the written files."""

    comparisons: tuple[Comparison, ...] = ()
    """Differences of each file from the source."""

    uncompared: str = ""
    """The reason why MuJoCo cannot load an MJCF source, whose forces are then not compared."""

    responses: tuple[StepResponse, ...] = ()
    """How the joints that a policy moves follow a step of their targets."""

    standing: StandResult | None = None
    """Result of the standing test of scene.xml; None without legs, or with a fixed base."""

    joints_locked: bool = False
    """Whether the joints were locked in the standing test, as for bipeds, which need balance."""

    stand_gains: bool = False
    """Whether the standing test used suggested gains instead of the spec's, which may be softer."""

    free_standing: StandResult | None = None
    """Result with the gains of the spec and without locked joints, if the standing test used other
    gains or locked joints. A failure is expected: the policy has to balance the robot."""

    error: str = ""
    """The reason why a robot with legs could not be simulated."""

    skipped: str = ""
    """The reason why there is no standing test for a robot that only a controller balances."""

    @property
    def differences(self) -> tuple[str, ...]:
        """What differs from the source, one sentence each."""
        return tuple(
            f"{compared.file} differs from the source: {phrase}"
            for compared in self.comparisons
            for phrase in compared.differences
        )

    @property
    def failures(self) -> tuple[str, ...]:
        """The reasons why the robot does not stand; empty if it stands, or has no legs."""
        if self.standing is None:
            return (f"it could not be simulated: {self.error}",) if self.error else ()
        return assess(self.standing).failures

    @property
    def is_stable(self) -> bool:
        """Whether the robot stood upright on its feet; True without legs."""
        return not self.failures


def verify(
    source: Facts,
    robot: RobotFiles,
    folder: Path,
    *,
    soft_gains: bool = False,
    ignored: Collection[str] = (),
) -> Verification:
    """Compare the files of a folder with their source, and simulate the standing pose.

    Args:
        source: Facts of the source file.
        robot: The robot that was written.
        folder: The folder with its files.
        soft_gains: Whether the gains of the spec need not hold the pose without a policy.
        ignored: What options change, which is not compared; see `compare_models`.

    Raises:
        ExportError: if MuJoCo cannot load the files.
    """
    floating = bool(robot.facts.model.floating)
    # MuJoCo releases the interpreter lock while it compiles. The scene includes robot.xml.
    with quiet_mujoco(), ThreadPoolExecutor(2) as executor:
        urdf, scene = (executor.submit(_load_model, folder / name) for name in (URDF, SCENE))
    (_, urdf_model), (scene_spec, scene_model) = urdf.result(), scene.result()
    scales = robot.spec.per_joint("action_scale")
    responses = tuple(
        response
        for response in step_responses(scene_model, scene_model.key_qpos[0])
        if scales[response.joint]
    )
    verification = replace(
        _compare(source, robot, {URDF: urdf_model, MJCF: scene_model}, ignored),
        responses=responses,
    )
    if not robot.facts.legs or not floating:
        return verification
    # A biped falls with any gains unless a policy balances it. With locked joints, the test still
    # shows that its feet carry it.
    joints_locked = not is_statically_stable(robot.facts.legs)
    if reason := why_it_balances(robot.facts):
        return replace(verification, skipped=reason)
    # Gains for training need not hold the pose, so a fall with them says nothing about the files.
    stand_gains = soft_gains and not joints_locked
    test = partial(
        stand_test,
        SimModel.from_mujoco(scene_model, spec=scene_spec, base=robot.facts.bodies[0].top.name),
        positions=robot.facts.default_pose,
        areas=contact_areas(robot.facts),
        seconds=_DURATION,
        ground_normal=ground_normal(robot.facts),
    )
    spec_gains = _gains(robot.spec)
    try:
        gains = suggest_gains(robot.facts) if stand_gains else spec_gains
        standing = test(gains, joints_locked=joints_locked)
        free_standing = test(spec_gains) if joints_locked or stand_gains else None
    except CannotCheckError as error:
        return replace(verification, error=str(error))
    return replace(
        verification,
        standing=standing,
        joints_locked=joints_locked,
        stand_gains=stand_gains,
        free_standing=free_standing,
    )


def _compare(
    source: Facts, robot: RobotFiles, models: Mapping[str, Any], ignored: Collection[str]
) -> Verification:
    """Return the comparison of the models of the written files with their source."""
    written = robot.facts
    described = with_hinges_for_balls(source)
    if written.model.floating:
        described = described.with_free_base()
    uncompared, reference = "", None
    if source.model.kind == "mjcf":
        try:
            reference = load_source(source)
        except CannotCheckError as error:
            uncompared = str(error)
    reference = reference or described_model(described, written)
    comparisons = tuple(
        compare_models(
            file,
            reference,
            model,
            base=written.bodies[0].top.name,
            mass=described.total_mass,
            pose=written.default_pose,
            base_joints=[joint.name for joint in source.base_joints],
            ignored=ignored if file == MJCF and not uncompared else ("forces", "shapes"),
        )
        for file, model in models.items()
    )
    return Verification(comparisons=comparisons, uncompared=uncompared)


def _load_model(path: Path) -> tuple[Any, Any]:
    """Return the specification and the model of a file, without shapes that are only drawn."""
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        written = {mesh.name: (mesh.file, mesh.scale.tolist()) for mesh in spec.meshes}
        remove_drawings(spec)
        kept = {mesh.name for mesh in spec.meshes}
        for name, (file, scale) in written.items():
            if name not in kept:
                # One by one, because MuJoCo takes about 800 bytes for each face.
                drawing = mujoco.MjSpec()
                drawing.modelfiledir = spec.modelfiledir
                drawing.add_mesh(name=name, file=file, scale=scale)
                drawing.worldbody.add_geom(
                    type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, contype=0, conaffinity=0
                )
                drawing.compile()
        return spec, spec.compile()
    except ValueError as error:
        reason = one_line(str(error))
        raise ExportError(f"MuJoCo cannot load the written {path.name}: {reason}") from None


def _gains(spec: RobotSpec) -> dict[str, Gain]:
    stiffness, damping, armature = map(spec.per_joint, ("stiffness", "damping", "armature"))
    return {
        joint: Gain(
            stiffness=stiffness[joint],
            damping=damping[joint],
            armature=armature[joint],
            reason="from the spec",
        )
        for joint in spec.joint_order
    }
