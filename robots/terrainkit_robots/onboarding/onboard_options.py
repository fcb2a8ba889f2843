"""The options of onboarding."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from terrainkit_robots.lint.settings import Settings

if TYPE_CHECKING:
    from terrainkit_robots.export.collision_simplification.simplify import CollisionMethod, Progress
    from terrainkit_robots.simulation.gain import GainSet


@dataclass(frozen=True, kw_only=True)
class OnboardOptions:
    """Options of `onboard`."""

    settings: Settings = field(default_factory=Settings)
    """ROS packages, xacro arguments and ignored rules; the settings files above the robot file are
    added. A selection of rules has no effect."""

    collision: "CollisionMethod" = "keep"
    """How collision meshes are simplified."""

    frameworks: tuple[str, ...] = ()
    """Training frameworks to write a configuration for."""

    map: Path | None = None
    """A map on which LeggedGym-Ex, one of `frameworks`, trains the robot."""

    name: str = ""
    """Name of the robot and of its tasks; by default the robot's name in the file."""

    floating: bool | None = None
    """Whether the base is floating; None to decide from the file and the legs."""

    spec: Path | None = None
    """A robot.toml whose values override the derived values, or a file with only its loops."""

    gains: "GainSet" = "stand"
    """PD gains to suggest: `stand` holds the default pose without a policy; `train` is as soft as
    published training configurations, with action scales of about 0.25 rad."""

    unsafe_fixes: bool = False
    """Whether to apply fixes that change a number, a shape or a mesh."""

    force: bool = False
    """Whether to continue despite blocking errors."""

    overwrite: bool = False
    """Whether to replace a folder that contains an onboarded robot."""

    render_images: bool = True
    """Whether to render pictures for the report."""

    cache_dir: Path | None = None
    """Folder that caches convex decompositions between runs."""

    progress: "Progress" = lambda items, _: items
    """Wraps an iterable of collision meshes to display a progress bar."""

    on_step: Callable[[str], None] = lambda _: None
    """Called with the name of each step when it starts."""
