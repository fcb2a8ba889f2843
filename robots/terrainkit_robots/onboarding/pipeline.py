"""The onboarding pipeline: check a robot file, repair, convert and verify it, and report."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from terrainkit.errors import ConfigError, TerrainkitError, listing
from terrainkit_robots.export.canonical import plain_name
from terrainkit_robots.lint.settings import read_settings
from terrainkit_robots.onboarding.convert import MJCF, convert
from terrainkit_robots.onboarding.folder import check_folder, find_edits, new_folder, write_files
from terrainkit_robots.onboarding.frameworks import leggedgym_ex
from terrainkit_robots.onboarding.frameworks.frameworks import check_framework, robot_config_files
from terrainkit_robots.onboarding.frameworks.naming import package_name
from terrainkit_robots.onboarding.onboard_options import OnboardOptions
from terrainkit_robots.onboarding.repair import check_and_repair
from terrainkit_robots.onboarding.result import PUBLISHED, OnboardResult
from terrainkit_robots.onboarding.statements import report_markdown
from terrainkit_robots.onboarding.verify import verify
from terrainkit_robots.rendering.child_process import RenderError
from terrainkit_robots.rendering.norms_picture import draw_norms
from terrainkit_robots.rendering.robot_images import render_robot
from terrainkit_robots.spec.loops import LoopSpec, load_spec

_MAP_FRAMEWORK = "leggedgym_ex"
"""The framework whose task trains on a map of `OnboardOptions`."""


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
    path, options = Path(path), options or OnboardOptions()
    for framework in options.frameworks:
        check_framework(framework)
    if options.name and package_name(options.name) != options.name:
        raise ConfigError(
            f"name: got {options.name!r}; expected a name such as {package_name(options.name)}"
        )
    if options.map is not None and _MAP_FRAMEWORK not in options.frameworks:
        got = listing(options.frameworks)
        raise ConfigError(f"framework for a map: got {got}; expected {_MAP_FRAMEWORK}")
    map_files = leggedgym_ex.map_files(options.map) if options.map is not None else {}
    if output is not None:
        check_folder(Path(output), overwrite=options.overwrite)
    user_spec, loop_spec = load_spec(options.spec) if options.spec else (None, LoopSpec())
    if user_spec is None:
        options = replace(options, spec=None)  # it has only loops, and all values are derived
    options.on_step(f"checking {path.name}")
    # All rules are needed to find blocking errors. The written files are simulated, not this one.
    settings = options.settings.over(read_settings(path.parent))
    settings = replace(settings, select=(), simulate=False)
    report, fixed = check_and_repair(path, settings, loop_spec, unsafe=options.unsafe_fixes)
    result = OnboardResult(report=report, fixed=fixed)
    for rule in result.report.crashed:
        raise TerrainkitError(f"{path}: {rule.code}: {rule.reason}")
    if not options.force and any(finding.is_blocking for finding in result.report.findings):
        return result
    # Again, since the default folder has the name of the robot, which is known now.
    target = Path(output or options.name or plain_name(result.report.facts.model))
    check_folder(target, overwrite=options.overwrite)
    options.on_step("deriving the default pose and the gains")
    robot = convert(result.report, options, user_spec)
    result = replace(result, folder=target, robot=robot)
    result, files = _with_configs(result, options, map_files)
    return _write_folder(result, target, {**robot.files, **files}, options)


def _with_configs(
    result: OnboardResult, options: OnboardOptions, map_files: Mapping[str, bytes]
) -> tuple[OnboardResult, dict[str, bytes]]:
    """Return the result with the names of the configurations, and their files by name."""
    assert result.robot is not None
    spec = result.robot.spec
    files: dict[str, bytes] = {}
    configs: dict[str, tuple[str, ...]] = {}
    skipped: dict[str, str] = {}
    for framework in options.frameworks:
        try:
            on_map = map_files if framework == _MAP_FRAMEWORK else {}
            texts = robot_config_files(framework, result.robot.facts, spec, has_map=bool(on_map))
        except ConfigError as error:
            skipped[framework] = str(error)
            continue
        if not files.keys().isdisjoint(texts) and framework not in configs:
            raise ConfigError(f"name: got {spec.name!r}, a framework; expected another one")
        configs[framework] = (*texts, *on_map)
        files |= {**{name: text.encode() for name, text in texts.items()}, **on_map}
    return replace(result, configs=configs, skipped_configs=skipped), files


def _write_folder(
    result: OnboardResult, target: Path, files: Mapping[str, bytes], options: OnboardOptions
) -> OnboardResult:
    """Write the folder, and return the result with its verification, pictures and edited files."""
    assert result.robot is not None
    edits = find_edits(target, files)
    with new_folder(target, overwrite=options.overwrite) as folder:
        options.on_step("simulating the standing pose")
        write_files(folder, files)
        # Another process renders the pictures at the same time.
        rendering = render_robot(folder / MJCF) if options.render_images else None
        # Gains of the file and gains for training may be too soft to hold the pose; suggested ones
        # for standing hold it, and the user vouches for those of a spec.
        stiffness = result.robot.spec.provenance.items()
        is_soft = options.spec is None and (
            options.gains == "train"
            or any(k.startswith("stiffness") and p.origin == "declared" for k, p in stiffness)
        )
        ignored = set() if options.collision == "keep" else {"shapes"}
        if options.spec is not None or options.gains != "stand":
            ignored.add("actuators")
        verification = verify(
            result.report.facts,
            result.robot,
            folder,
            soft_gains=is_soft,
            ignored=ignored,
        )
        options.on_step("rendering pictures")
        images: dict[str, bytes] = {}
        images_error = "" if rendering else "disabled"
        try:
            for name, image in rendering or ():
                images[f"report/{name}.png"] = image
        except RenderError as error:
            images, images_error = {}, str(error)
        if options.render_images:
            spec = result.robot.spec
            damping = spec.per_joint("damping")
            gains = {name: (kp, damping[name]) for name, kp in spec.per_joint("stiffness").items()}
            images[PUBLISHED] = draw_norms(result.report.facts, gains)
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
