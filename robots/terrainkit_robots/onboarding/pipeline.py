"""The onboarding pipeline: check a robot file, fix it, write its folder and verify the result."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from terrainkit.errors import ConfigError, TerrainkitError
from terrainkit_robots.export.canonical import plain_name
from terrainkit_robots.lint.check import check_robot
from terrainkit_robots.lint.rule import Finding
from terrainkit_robots.lint.runner import Report
from terrainkit_robots.lint.settings import Settings, read_settings
from terrainkit_robots.onboarding.folder import check_folder, find_edits, new_folder, write_files
from terrainkit_robots.onboarding.frameworks.frameworks import check_framework, robot_config_files
from terrainkit_robots.onboarding.frameworks.naming import package_name
from terrainkit_robots.onboarding.placeholder_effort import placeholder_effort
from terrainkit_robots.onboarding.repairs import with_repairs_marked_safe
from terrainkit_robots.onboarding.report_md import report_markdown
from terrainkit_robots.onboarding.result import OnboardResult
from terrainkit_robots.onboarding.robot_files import (
    MJCF,
    RobotFiles,
    SpecOverride,
    make_robot_files,
)

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

    name: str = ""
    """Name of the robot and of its tasks; by default the robot's name in the file."""

    floating: bool | None = None
    """Whether the base is floating; None to decide from the file and the legs."""

    spec: Path | None = None
    """A robot.toml whose values override the derived values."""

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


def onboard(
    path: str | Path, output: str | Path | None = None, options: OnboardOptions | None = None
) -> OnboardResult:
    """Convert a robot file into a folder for training; the file itself is not changed.

    The folder contains robot.toml (default pose, gains, names), robot.urdf, robot.xml, scene.xml,
    meshes, report.md and the requested framework configurations.

    Args:
        path: A URDF, xacro or MJCF file, or the name of a robot; see `find_robot`.
        output: The folder to write. By default it has the robot's name and is created in the
            working directory.
        options: The options.

    Returns:
        The report and the written files. If blocking errors remain, and `options.force` is False,
        nothing is written and `folder` is None.

    Raises:
        TerrainkitError: if a file cannot be read or written, an option is invalid, or MuJoCo
            rejects the robot.
    """
    from terrainkit_robots.spec.robot_spec import RobotSpec

    path, options = Path(path), options or OnboardOptions()
    for framework in options.frameworks:
        check_framework(framework)
    if options.name and package_name(options.name) != options.name:
        raise ConfigError(
            f"name: got {options.name!r}; expected a name such as {package_name(options.name)}"
        )
    if output is not None:
        check_folder(Path(output), overwrite=options.overwrite)
    user_spec = None
    if options.spec is not None:
        user_spec = SpecOverride(spec=RobotSpec.load(options.spec), file=str(options.spec))
    options.on_step(f"checking {path.name}")
    report, fixed = _fix_in_memory(path, options)
    for rule in report.crashed:
        raise TerrainkitError(f"{path}: {rule.code}: {rule.reason}")
    if not options.force and any(finding.is_blocking for finding in report.findings):
        return OnboardResult(report=report, fixed=fixed)
    target = Path(output or options.name or plain_name(report.facts.model))
    check_folder(target, overwrite=options.overwrite)
    options.on_step("deriving the default pose and the gains")
    robot_files = make_robot_files(
        report.facts,
        name=options.name,
        collision=options.collision,
        floating=options.floating,
        user_spec=user_spec,
        gain_set=options.gains,
        unknown_effort=placeholder_effort(report.facts, report.findings),
        cache_dir=options.cache_dir,
        progress=options.progress,
    )
    configs, skipped_configs = _config_files(options.frameworks, robot_files)
    files = {name: data for texts in configs.values() for name, data in texts.items()}
    if len(files) < sum(map(len, configs.values())):
        raise ConfigError(f"name: got {robot_files.spec.name!r}, a framework; expected another one")
    result = OnboardResult(
        report=report,
        fixed=fixed,
        folder=target,
        robot=robot_files,
        configs={framework: tuple(texts) for framework, texts in configs.items()},
        skipped_configs=skipped_configs,
    )
    return _write_folder(result, target, {**robot_files.files, **files}, options)


def _fix_in_memory(path: Path, options: OnboardOptions) -> tuple[Report, tuple[Finding, ...]]:
    """Return the report after all fixes, and the findings that were fixed."""
    from terrainkit_robots.lint.fixes.apply import fix_robot

    settings = options.settings.over(read_settings(path.parent))
    # All rules are needed to find blocking errors. The written files are simulated, not this one.
    settings = replace(settings, select=(), simulate=False)
    report = with_repairs_marked_safe(check_robot(path, settings))
    fixed: tuple[Finding, ...] = ()
    if report.facts.model.kind != "xacro" and any(f.fix is not None for f in report.findings):

        def check(contents: Mapping[Path, bytes]) -> Report:
            return with_repairs_marked_safe(check_robot(path, settings, contents=contents))

        result = fix_robot(path, check, report=report, unsafe=options.unsafe_fixes)
        report, fixed = result.report, result.fixed
    by_export = [f for f in report.findings if f.severity == "error" and f.onboarding == "converts"]
    remaining = tuple(f for f in report.findings if f not in by_export)
    # The fix of the lint rule is not applied, so its description is removed.
    fixed = (*fixed, *(replace(finding, fix=None) for finding in by_export))
    return replace(report, findings=remaining), fixed


def _config_files(
    frameworks: Iterable[str], robot_files: RobotFiles
) -> tuple[dict[str, dict[str, bytes]], dict[str, str]]:
    """Return the files for each framework by name, and why frameworks are skipped."""
    configs: dict[str, dict[str, bytes]] = {}
    skipped: dict[str, str] = {}
    for framework in frameworks:
        try:
            texts = robot_config_files(framework, robot_files.facts, robot_files.spec)
        except ConfigError as error:
            skipped[framework] = str(error)
        else:
            configs[framework] = {name: text.encode() for name, text in texts.items()}
    return configs, skipped


def _write_folder(
    result: OnboardResult, target: Path, files: Mapping[str, bytes], options: OnboardOptions
) -> OnboardResult:
    """Write the folder, and return the result with its verification, pictures and edited files."""
    from terrainkit_robots.onboarding.verify import verify
    from terrainkit_robots.rendering.child_process import RenderError
    from terrainkit_robots.rendering.robot_images import render_robot

    assert result.robot is not None
    edits = find_edits(target, files)
    with new_folder(target, overwrite=options.overwrite) as folder:
        options.on_step("simulating the standing pose")
        write_files(folder, files)
        # Another process renders the pictures at the same time.
        rendering = render_robot(folder / MJCF) if options.render_images else None
        stiffness = result.robot.spec.provenance.items()
        is_soft = options.spec is None and (
            options.gains == "train"
            or any(k.startswith("stiffness") and p.origin == "declared" for k, p in stiffness)
        )
        verification = verify(result.report.facts, result.robot, folder, soft_gains=is_soft)
        options.on_step("rendering pictures")
        images: dict[str, bytes] = {}
        images_error = "" if rendering else "disabled"
        try:
            for name, image in rendering or ():
                images[f"report/{name}.png"] = image
        except RenderError as error:
            images, images_error = {}, str(error)
        write_files(folder, {**images, **edits})
        result = replace(
            result,
            verification=verification,
            images=tuple(images),
            images_error=images_error,
            edits=tuple(edits),
        )
        write_files(folder, {"report.md": report_markdown(result).encode()})
    return result
