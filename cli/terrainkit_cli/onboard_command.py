"""The command that brings a new robot in."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from terrainkit.errors import ConfigError
from terrainkit_cli import render
from terrainkit_cli.parse import Command
from terrainkit_cli.robot_options import (
    Output,
    Packages,
    Text,
    Words,
    XacroArguments,
    find_robot,
    listed,
    packages,
    reasons,
    repeated,
    xacro_arguments,
)

if TYPE_CHECKING:
    from terrainkit_robots.onboarding.pipeline import BroughtIn, Wishes


@dataclass(frozen=True, kw_only=True)
class Onboard(Command):
    """Bring a robot in: from its URDF, xacro or MJCF file to a folder that is ready to train on.

    The file is checked, and repaired where that is safe; the folder gets robot.toml (pose, gains,
    names: edit it), robot.urdf, robot.xml, scene.xml, meshes, and report.md with pictures. Then the
    robot is simulated, to show that it stands. The file itself is never changed.

    Exit code 0: done. 1: errors are left in the file, or the robot did not stand. 2: a file cannot
    be opened or written, or an option is wrong.
    """

    file: Annotated[
        str, tyro.conf.Positional, tyro.conf.arg(metavar="FILE", help_behavior_hint="")
    ] = ""
    """The robot's file, or the name of a bundled robot: quadruped, biped."""

    output: Output = ""
    """Folder to write; unless given, one with the robot's name here."""

    collision: Literal["keep", "hull", "coacd", "primitives"] = "keep"
    """What becomes of collision meshes: kept, their convex hulls, convex parts by CoACD where they
    are far from convex, or the box, cylinder, capsule or ball that fits each best."""

    config: Annotated[Words, *repeated("FRAMEWORK")] = field(default_factory=list)
    """Also write the configuration of: legged_gym, leggedgym_ex, isaaclab, mjlab, genesis."""

    base: Literal["auto", "floating", "fixed"] = "auto"
    """Whether the base moves freely. Of itself, it does with legs, with wheels, or if the file says
    so."""

    spec: Text = ""
    """A robot.toml whose values go before what would be suggested: one that you have edited."""

    unsafe_fixes: bool = False
    """Repair more: also where a number, a shape or a mesh changes. The file stays as it is."""

    force: bool = False
    """Go on although errors are left that make another robot of it: in the text, the tree, joints,
    meshes or masses."""

    overwrite: bool = False
    """Replace the folder, if it is an onboarded robot."""

    no_pictures: bool = False
    """Draw no pictures."""

    ignore: Annotated[Words, *repeated("CODES=REASON")] = field(default_factory=list)
    """Do not ask these rules; the reason goes into the report."""

    package: Packages = field(default_factory=list)
    """Folder of a ROS package, for package:// and $(find ...)."""

    xacro_arg: XacroArguments = field(default_factory=list)
    """Value of a xacro argument."""

    def run(self) -> int:
        """Bring the robot in, and tell what was done."""
        from terrainkit_robots.onboarding.pipeline import bring_in
        from terrainkit_robots.onboarding.summary import summary

        if not self.file:
            raise ConfigError("no FILE to onboard; wanted one, or quadruped, or biped")
        with render.steps() as steps:
            done = bring_in(find_robot(self.file), self._wishes(steps))
        if done.folder is None:
            render.report(_refusal(done))
            render.error(f"{self.file}: errors are left{_advice(done, self)}; nothing was written")
            return 1
        render.table([(f"  {word}", text) for word, text in summary(done)])
        render.result(f"wrote {done.folder}; look at it, from its keyframe `home` on:")
        render.result(f"  {_viewer(done.folder)}")
        faults = _faults(done)
        for fault in faults:
            render.error(f"{self.file}: {fault}")
        return int(bool(faults))

    def _wishes(self, steps: render.Steps) -> "Wishes":
        from functools import partial

        from terrainkit_robots.export.collision_simplification.decomposition_cache import (
            cache_folder,
        )
        from terrainkit_robots.lint.settings import Settings
        from terrainkit_robots.onboarding.pipeline import Wishes

        return Wishes(
            target=Path(self.output) if self.output else None,
            settings=Settings(
                ignore=reasons(self.ignore),
                packages=packages(self.package),
                xacro_arguments=xacro_arguments(self.xacro_arg),
            ),
            collision=self.collision,
            configs=tuple(word for words in self.config for word in listed(words)),
            floating={"auto": None, "floating": True, "fixed": False}[self.base],
            spec=Path(self.spec) if self.spec else None,
            unsafe=self.unsafe_fixes,
            cache=cache_folder(),
            force=self.force,
            overwrite=self.overwrite,
            pictures=not self.no_pictures,
            say=steps.say,
            progress=partial(steps.bar, of="collision meshes"),
        )


def _refusal(done: "BroughtIn") -> str:
    """Return the errors of a robot that was not brought in."""
    from dataclasses import replace

    from terrainkit_robots.lint.report import format_reports
    from terrainkit_robots.onboarding.pipeline import keeps_out

    errors = tuple(filter(keeps_out, done.report.findings))
    return format_reports([replace(done.report, findings=errors)], "text")


def _advice(done: "BroughtIn", command: Onboard) -> str:
    """Return what to do about errors that keep a robot out."""
    if not done.report.facts.bodies:
        return ""
    unsafe = sum(f.severity == "error" and f.fix is not None for f in done.report.findings)
    if unsafe and not command.unsafe_fixes:
        return f", of which --unsafe-fixes repairs {unsafe}"
    return "; --force goes on as far as MuJoCo does"


def _viewer(folder: Path) -> str:
    from shlex import quote

    return f"python -m mujoco.viewer --mjcf={quote(str(folder / 'scene.xml'))}"


def _faults(done: "BroughtIn") -> list[str]:
    """Return why a robot that was written is not yet one to train."""
    from terrainkit_robots.lint.report.summary import count

    left = [finding for finding in done.report.findings if finding.severity == "error"]
    codes = ", ".join(dict.fromkeys(finding.code for finding in left))
    faults = [f"{count(len(left), 'error')} left ({codes}); see report.md"] if left else []
    if done.proof is not None and not done.proof.stood:
        faults.append(f"it does not stand: {'; '.join(done.proof.faults)}")
    return faults
