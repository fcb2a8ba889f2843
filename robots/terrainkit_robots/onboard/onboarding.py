"""Onboarding: from the facts of a robot to the files of its folder, in memory.

What was read is brought into its normal form, its meshes are packed, gains and poses are suggested
where the file has none, and everything is written as text. Nothing here touches the disk.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from terrainkit_robots.facts import Facts
from terrainkit_robots.mesh.meshes import Meshes
from terrainkit_robots.rule import CannotCheckError
from terrainkit_robots.writing.drive import Drive
from terrainkit_robots.writing.mjcf_text import Extras, mjcf_text, scene_text
from terrainkit_robots.writing.normal_form import normal_form
from terrainkit_robots.writing.sites import foot_sites, imu_site

if TYPE_CHECKING:
    from terrainkit_robots.spec.robot_spec import RobotSpec
    from terrainkit_robots.writing.collision import How

_AT_REST = 1e-4
"""Shapes that are deeper than this inside each other at the standing pose push each other [m]."""

_DRIVEN = ("stiffness", "damping", "effort", "armature")
"""What a motor takes from the spec."""

Progress = Callable[[Iterable[Any], int], Iterable[Any]]
"""Draws a bar while it passes on so many things."""


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


def onboard(
    source: Facts,
    *,
    collision: "How" = "keep",
    floating: bool | None = None,
    spec: "RobotSpec | None" = None,
    cache: Path | None = None,
    progress: Progress = lambda items, _: items,
) -> Onboarded:
    """Return a robot's files: robot.toml, robot.urdf, robot.xml, scene.xml and its meshes.

    Args:
        source: The robot as it was read.
        collision: What becomes of its collision meshes.
        floating: Whether the base moves freely; unless told, as the file says or the legs suggest.
        spec: Values that were edited or measured, which go before what would be suggested.
        cache: Folder that keeps convex parts from one run to the next.
        progress: Draws a bar while collision meshes are worked on.

    Raises:
        TerrainkitError: if there is no robot, a mesh of it cannot be had, or MuJoCo refuses it.
    """
    from terrainkit_robots.simulation.gains import suggest_gains
    from terrainkit_robots.spec.derive import derive_spec
    from terrainkit_robots.spec.spec_file import to_toml
    from terrainkit_robots.writing.collision import treat
    from terrainkit_robots.writing.leftovers import leftovers
    from terrainkit_robots.writing.packed import pack
    from terrainkit_robots.writing.urdf_text import urdf_text

    form = normal_form(source, floating=floating)
    treated = treat(form.model, source.meshes, collision, cache=cache, progress=progress)
    packed = pack(treated.model, treated.meshes)
    contents = {Path(name): data for name, data in packed.files.items()}
    facts = Facts(packed.model, Meshes(contents), spec=spec)
    if spec is None:
        spec = derive_spec(facts, gains=suggest_gains(facts), floating=bool(form.model.floating))
    excluded, said = _excluded(facts)
    extras = Extras(
        drives=_drives(spec),
        feet=foot_sites(facts),
        imu=imu_site(facts),
        excluded=excluded,
        home=facts.positions,
        height=_height(facts),
    )
    texts = {
        spec.urdf: urdf_text(packed.model, feet=spec.feet),
        spec.mjcf: mjcf_text(packed.model, extras),
        "scene.xml": scene_text(packed.model.name, height=max(extras.height, 0.1)),
        "robot.toml": to_toml(spec),
    }
    return Onboarded(
        facts=facts,
        spec=spec,
        files={name: text.encode() for name, text in texts.items()} | dict(packed.files),
        notes=(*form.notes, *leftovers(source.model), *treated.notes, *packed.notes, *said),
    )


def _drives(spec: "RobotSpec") -> dict[str, Drive]:
    columns = {name: spec.per_joint(name) for name in _DRIVEN}
    return {
        joint: Drive(**{name: values[joint] for name, values in columns.items()})
        for joint in spec.joint_order
    }


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
    if facts.stance is not None:
        return facts.stance.height
    if not facts.model.floating:
        return 0.0
    from terrainkit_robots.body.kinematics import body_poses
    from terrainkit_robots.body.shapes import lowest

    poses = body_poses(facts.bodies, facts.positions)
    depths = [
        lowest(shape, pose, facts.meshes)
        for body, pose in zip(facts.bodies, poses, strict=True)
        for shape in (*body.collisions, *body.visuals)
    ]
    return max(0.0, -min(depths, default=0.0))
