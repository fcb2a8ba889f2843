"""Bringing a robot in: read, repair, write, and prove, in the order that a newcomer would."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from terrainkit.errors import TerrainkitError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.export.canonical import plain_name
from terrainkit_robots.lint.runner import Report
from terrainkit_robots.lint.settings import Settings, read_settings
from terrainkit_robots.onboarding.folder import check_folder, new_folder, of_before, write_files
from terrainkit_robots.onboarding.robot_files import MJCF, Given, Onboarded, onboard

if TYPE_CHECKING:
    from terrainkit_robots.export.collision_simplification.simplify import How, Progress
    from terrainkit_robots.lint.runner import Finding
    from terrainkit_robots.onboarding.verify import Proof


def _unwrapped(items: Any, _total: int) -> Any:
    return items


def _silent(_step: str) -> None:
    pass


@dataclass(frozen=True, kw_only=True)
class Wishes:
    """How a robot is to be brought in."""

    target: Path | None = None
    """Folder to write; None for one with the robot's name in the current folder."""

    settings: Settings = field(default_factory=Settings)
    """Packages, xacro arguments and rules that are not asked; those of files above the robot's own
    are added."""

    collision: "How" = "keep"
    """What becomes of collision meshes."""

    configs: tuple[str, ...] = ()
    """Frameworks to write a configuration for."""

    floating: bool | None = None
    """Whether the base moves freely; None to find out."""

    spec: Path | None = None
    """A robot.toml whose values go before what would be suggested."""

    unsafe: bool = False
    """Whether repairs that change a number, a shape or a mesh are made, too."""

    force: bool = False
    """Whether to go on although parts, meshes or masses are not sound."""

    overwrite: bool = False
    """Whether a folder that is an onboarded robot may be replaced."""

    pictures: bool = True
    """Whether pictures are drawn."""

    cache: Path | None = None
    """Folder that keeps convex parts from one run to the next."""

    progress: "Progress" = _unwrapped
    """Draws a bar while collision meshes are worked on."""

    say: Callable[[str], None] = _silent
    """Is told what is done next."""


@dataclass(frozen=True, kw_only=True, eq=False)
class BroughtIn:
    """What became of a robot."""

    report: Report
    """What is found in it after the repairs."""

    repaired: tuple["Finding", ...] = ()
    """What was found before, and repaired in what is written."""

    folder: Path | None = None
    """The folder that was written; None if errors kept the robot out."""

    made: Onboarded | None = None
    """What was written to it."""

    proof: "Proof | None" = None
    """Whether that is the robot that was read, and whether it stands."""

    configs: tuple[str, ...] = ()
    """Configuration files."""

    pictures: tuple[str, ...] = ()
    """Picture files."""

    no_pictures: str = ""
    """Why there are no pictures."""

    kept: tuple[str, ...] = ()
    """Files with what was edited in the folder before."""


def bring_in(file: Path, wishes: Wishes) -> BroughtIn:
    """Bring a robot in; its own file is not changed.

    Raises:
        TerrainkitError: if a file cannot be read or written, or an option is wrong.
    """
    from terrainkit_robots.onboarding.report_md import report_page
    from terrainkit_robots.onboarding.verify import prove
    from terrainkit_robots.spec.robot_spec import RobotSpec

    _check_frameworks(wishes.configs)
    if wishes.target is not None:
        check_folder(wishes.target, overwrite=wishes.overwrite)
    given = Given(spec=RobotSpec.load(wishes.spec), file=str(wishes.spec)) if wishes.spec else None
    wishes.say(f"checking {file.name}")
    report, repaired = _mended(*_repaired(file, wishes))
    for crash in report.crashed:
        raise TerrainkitError(f"{file}: {crash.code}: {crash.reason}")
    if not wishes.force and any(map(keeps_out, report.findings)):
        return BroughtIn(report=report, repaired=repaired)
    target = wishes.target or Path(plain_name(report.facts.model))
    check_folder(target, overwrite=wishes.overwrite)
    wishes.say("finding the pose and the gains")
    made = onboard(
        report.facts,
        collision=wishes.collision,
        floating=wishes.floating,
        given=given,
        cache=wishes.cache,
        progress=wishes.progress,
    )
    configs = _configs(made, wishes.configs)
    kept = of_before(target, {**made.files, **configs})
    with new_folder(target, overwrite=wishes.overwrite) as folder:
        wishes.say("proving that it stands")
        write_files(folder, made.files)
        write_files(folder, configs)
        # The pictures are drawn by another process, which there is no need to wait for.
        with ThreadPoolExecutor(1) as beside:
            drawing = beside.submit(_pictures, folder) if wishes.pictures else None
            proof = prove(report.facts, made, folder)
            wishes.say("drawing pictures")
        pictures, no_pictures = drawing.result() if drawing else ({}, "not wanted")
        write_files(folder, dict(pictures) | kept)
        done = BroughtIn(
            report=report,
            repaired=repaired,
            folder=target,
            made=made,
            proof=proof,
            configs=tuple(configs),
            pictures=tuple(pictures),
            no_pictures=no_pictures,
            kept=tuple(kept),
        )
        write_files(folder, {"report.md": report_page(done).encode()})
    return done


_SOUND = ("XML", "MSH", "TRE", "INR", "JNT001", "JNT004", "JNT007", "JNT013")
"""Rules, or families of them, whose errors mean that what would be written is not the robot that
was meant: a joint of an unknown type would be fixed, one with inverted limits have none. With other
errors, such as limits that are missing, it is that robot, and not yet one to train."""


_MENDED = frozenset({"MSH002", "MSH004", "MSH005", "MSH007", "MSH008", "XML014"})
"""Errors that are not in what is written. Mesh files are copied, whatever they were called and in
whatever format; a copy that cannot be made of a collision mesh keeps the robot out. Rotations are
written as roll, pitch and yaw."""


def _mended(
    report: Report, repaired: tuple["Finding", ...]
) -> tuple[Report, tuple["Finding", ...]]:
    """Return what is found and what is repaired, when the robot is written anew."""
    gone = [f for f in report.findings if f.severity == "error" and f.code in _MENDED]
    left = tuple(f for f in report.findings if f not in gone)
    # What the fix would have done to the files is not what is done.
    return replace(report, findings=left), (*repaired, *(replace(f, fix=None) for f in gone))


def _check_frameworks(frameworks: Sequence[str]) -> None:
    """Raise an error if there is no such framework."""
    if frameworks:
        from terrainkit_robots.onboarding.frameworks.frameworks import file_name

        for name in frameworks:
            file_name(name)


def _configs(made: Onboarded, frameworks: Sequence[str]) -> dict[str, bytes]:
    """Return configurations by the names of their files."""
    if not frameworks:
        return {}
    from terrainkit_robots.onboarding.frameworks.frameworks import config_of, file_name

    texts = {file_name(name): config_of(name, made.facts, made.spec) for name in frameworks}
    return {name: text.encode() for name, text in texts.items()}


def keeps_out(finding: "Finding") -> bool:
    """Return whether a finding means that what would be written is another robot."""
    return finding.severity == "error" and finding.code.startswith(_SOUND)


def _repaired(file: Path, wishes: Wishes) -> tuple[Report, tuple["Finding", ...]]:
    """Return what is found in a robot once it is repaired in memory, and what was repaired."""
    from terrainkit_robots.description.load import load_robot
    from terrainkit_robots.lint.fixes.apply import fix_robot
    from terrainkit_robots.lint.selection import lint_selected
    from terrainkit_robots.mesh.mesh_cache import Meshes

    # What is simulated is what will be written, not what was read; and what may keep a robot out
    # is always asked.
    found_settings = wishes.settings.over(read_settings(file.parent))
    settings = replace(found_settings, select=(), simulate=False)

    def look(contents: Mapping[Path, bytes]) -> Report:
        model = load_robot(
            file,
            packages=settings.packages,
            xacro_arguments=settings.xacro_arguments,
            contents=contents,
        )
        return lint_selected(Facts(model, Meshes(contents)), settings, contents)

    found = look({})
    fixable = [f for f in found.findings if f.fix is not None]
    if found.facts.model.kind == "xacro" or not fixable:
        return found, ()
    result = fix_robot(file, lambda c: look(c) if c else found, unsafe=wishes.unsafe)
    return result.report, result.fixed


def _pictures(folder: Path) -> tuple[dict[str, bytes], str]:
    """Return pictures by the names of their files, and why there are none."""
    from terrainkit_robots.rendering.child_process import RenderError
    from terrainkit_robots.rendering.robot_pictures import render_robot

    try:
        drawn = render_robot(folder / MJCF)
    except RenderError as error:
        return {}, str(error)
    return {f"report/{name}.png": data for name, data in drawn.items()}, ""
