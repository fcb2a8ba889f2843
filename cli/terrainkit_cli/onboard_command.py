"""The command that onboards a robot."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Literal

from terrainkit.errors import ConfigError
from terrainkit_cli import render
from terrainkit_cli.argument_types import (
    Feet,
    IgnoredRules,
    InputPath,
    OutputPath,
    Packages,
    XacroArguments,
    parse_settings,
    split_commas,
)
from terrainkit_cli.parse import Command, option, positional

if TYPE_CHECKING:
    from terrainkit_robots.onboarding.onboard_options import OnboardOptions
    from terrainkit_robots.onboarding.result import OnboardResult


@dataclass(frozen=True, kw_only=True)
class Onboard(Command):
    """Convert a robot file into a folder that is ready for training.

    The command checks the file (URDF, xacro or MJCF), applies safe fixes and derives a default pose
    and PD gains. The folder contains robot.toml (pose, gains, names: edit it), robot.urdf,
    robot.xml, scene.xml, meshes, and report.md with pictures. The robot is then simulated to test
    that it stands. The input file is never changed.

    Exit code 0: the folder was written. 1: errors prevent that, or the written robot moves
    differently than the file; with --strict, also if errors remain in the file, the robot does not
    stand, or a framework was skipped. 2: a file cannot be read or written, or an option is
    invalid.
    """

    file: Annotated[str, positional("FILE")] = ""
    """The robot file, or the name of a robot: quadruped, biped, or one of the package
    robot_descriptions, such as go2_description."""

    output: OutputPath | None = None
    """Folder to write; by default, a folder with the name of the robot."""

    collision: Literal["keep", "hull", "coacd", "primitives"] = "keep"
    """Simplify collision meshes: keep them; replace them by their convex hulls; decompose
    nonconvex meshes into convex parts with CoACD; or fit a box, cylinder, capsule or sphere."""

    config: Annotated[tuple[str, ...], option("FRAMEWORK", is_repeated=True)] = ()
    """Also write the configuration files of a training framework: legged_gym, leggedgym_ex,
    isaaclab, mjlab, genesis."""

    map: InputPath | None = None
    """For --config leggedgym_ex: train on this map (.npz), with its terrain, a curriculum, measured
    heights and the rewards for rough terrain. Genesis requires a map without solids there."""

    name: Annotated[str, option("NAME")] = ""
    """Name of the robot, of its tasks in training frameworks and of their packages, such as
    my_robot; by default the robot's name in the file."""

    base: Literal["auto", "floating", "fixed"] = "auto"
    """Type of the base: floating, or fixed to the world. With auto, it is floating if the file
    says so, or if the robot has legs or wheels."""

    spec: InputPath | None = None
    """A robot.toml, such as an edited one, whose values override the derived values; or a file with
    nothing but the closed loops of a URDF and its motors (loops, joint_order)."""

    gains: Literal["stand", "train"] = "stand"
    """PD gains: stand uses the gains of position controllers in the file, or suggested ones that
    hold the default pose without a policy; train has softer gains, as in published configurations,
    with action scales of about 0.25 rad."""

    unsafe_fixes: bool = False
    """Also apply fixes that change a number, a shape or a mesh. The input file is not changed."""

    force: bool = False
    """Continue even if errors remain in the XML, the tree, joints, meshes or masses. The result
    may differ from the robot."""

    strict: bool = False
    """Exit with code 1 also if errors remain in the file, or the robot does not stand or does not
    fit a framework of --config. The folder is written anyway."""

    overwrite: bool = False
    """Replace the folder if it contains an onboarded robot."""

    pictures: bool = True
    """Render the pictures of report.md."""

    ignore: IgnoredRules = ()
    """Ignore these rules; the reason is written to the report."""

    package: Packages = ()
    """Folder of a ROS package, for package:// and $(find ...)."""

    xacro_arg: XacroArguments = ()
    """Value of a xacro argument of the file."""

    feet: Feet = ()
    """Links that are the feet, comma-separated, if they are not found."""

    def run(self) -> int:
        """Onboard the robot and print a summary."""
        from terrainkit_robots.onboarding.pipeline import onboard
        from terrainkit_robots.onboarding.statements import summarize

        if not self.file:
            raise ConfigError("FILE: missing; expected a robot file, quadruped, or biped")
        with render.steps() as steps:
            result = onboard(self.file, self.output, self._options(steps))
        if result.folder is None:
            render.report(_blocking_errors(result))
            render.error(f"{self.file}: errors remain{self._hint(result)}; nothing was written")
            return 1
        render.table([(f"  {label}", text) for label, text in summarize(result)])
        render.result(f"wrote {result.folder}; view the robot with:")
        scene = quote(str(result.folder / "scene.xml"))
        render.result(f"  python -m mujoco.viewer --mjcf={scene}")
        for line in _train_commands(result):
            render.report(f"{line}\n")  # with absolute paths: for use in another folder
        warnings = _remaining_errors(result) + _warnings(result)
        for warning in warnings:
            render.note(f"warning: {self.file}: {warning}")
        checks = result.verification
        return int(bool((self.strict and warnings) or (checks and checks.differences)))

    def _options(self, steps: render.Steps) -> "OnboardOptions":
        from terrainkit_robots.export.collision_simplification.decomposition_cache import (
            cache_folder,
        )
        from terrainkit_robots.onboarding.onboard_options import OnboardOptions

        return OnboardOptions(
            settings=parse_settings(self.ignore, self.package, self.xacro_arg, self.feet),
            collision=self.collision,
            map=self.map,
            name=self.name,
            frameworks=tuple(word for words in self.config for word in split_commas(words)),
            floating={"auto": None, "floating": True, "fixed": False}[self.base],
            spec=self.spec,
            gains=self.gains,
            unsafe_fixes=self.unsafe_fixes,
            force=self.force,
            overwrite=self.overwrite,
            render_images=self.pictures,
            cache_dir=cache_folder() if self.collision == "coacd" else None,
            progress=partial(steps.bar, of="collision meshes"),
            on_step=steps.update,
        )

    def _hint(self, result: "OnboardResult") -> str:
        """Return which option helps with the blocking errors."""
        if not result.report.facts.bodies:
            return ""
        findings = result.report.findings
        num_fixable = sum(f.severity == "error" and f.fix is not None for f in findings)
        if num_fixable and not self.unsafe_fixes:
            return f", {num_fixable} of them fixable with --unsafe-fixes"
        return "; --force ignores them where MuJoCo accepts the robot"


def _train_commands(result: "OnboardResult") -> Iterator[str]:
    """Yield the commands that train the robot, for each framework that has them."""
    from terrainkit_robots.onboarding.frameworks.frameworks import train_commands

    assert result.folder is not None
    assert result.robot is not None
    for framework in result.configs:
        place, commands = train_commands(framework, result.robot.spec, result.folder)
        if commands:
            yield f"train it in {place} with:"
            yield from (f"  {command}" for command in commands)


def _blocking_errors(result: "OnboardResult") -> str:
    """Return a report on the errors that prevent onboarding."""
    from terrainkit_robots.lint.report import to_text

    errors = tuple(finding for finding in result.report.findings if finding.is_blocking)
    return to_text([replace(result.report, findings=errors)], "text")


def _remaining_errors(result: "OnboardResult") -> list[str]:
    """Return a summary of the errors of a robot that was written."""
    from terrainkit_robots.lint.report.grouping import group_findings
    from terrainkit_robots.text import count

    findings = [finding for finding in result.report.findings if finding.severity == "error"]
    errors = [group.first for group in group_findings(result.report.facts.model, findings)]
    codes = ", ".join(dict.fromkeys(finding.code for finding in errors))
    remain = "remains" if len(errors) == 1 else "remain"
    return [f"{count(len(errors), 'error')} {remain} ({codes}); see report.md"] if errors else []


def _warnings(result: "OnboardResult") -> list[str]:
    """Return what was skipped, and why a robot that was written may not be ready for training."""
    skipped = result.skipped_configs.items()
    warnings = [f"no configuration for {framework}: {reason}" for framework, reason in skipped]
    # A robot whose legs were not all found was onboarded as another robot.
    warnings += [f.message for f in result.report.findings if f.onboarding == "warns"]
    verification = result.verification
    if verification is not None and not verification.is_stable:
        warnings.append(f"the robot does not stand: {'; '.join(verification.failures)}")
    if verification is not None:
        responses = (r for r in verification.responses if r.failure)
        warnings += [f"{response.joint} {response.failure}" for response in responses]
    return warnings
