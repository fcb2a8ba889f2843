"""The command that shows what a policy does."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from terrainkit.errors import ConfigError
from terrainkit_cli import render
from terrainkit_cli.evaluate_command import PolicyCommand, headline, number
from terrainkit_cli.robot_options import Output
from terrainkit_cli.training_extra import require_training

if TYPE_CHECKING:
    from terrainkit_robots.policy.score import Evaluation
    from terrainkit_robots.rendering.video import VideoSpec


@dataclass(frozen=True, kw_only=True)
class Play(PolicyCommand):
    """Show a policy walk: a video (.mp4), and a table of errors, falls and success.

    On a plane, robots march in formation, as --command says, or through a tour of commands. On a
    map, there is one on each patch, and the video visits some of them, on different terrains.
    """

    seconds: float = 12.0
    """How long robots walk, and how long the video is [s]."""

    output: Output = ""
    """The video to write; unless given, it is called as the run, here."""

    robots: int = 4
    """On a map, how many robots the video visits, one after the other."""

    size: Annotated[
        tuple[int, int],
        tyro.conf.arg(metavar="WIDTH HEIGHT", help_behavior_hint="(default: 640 360)"),
    ] = (640, 360)
    """Size of the video [pixels]."""

    no_video: bool = False
    """Only print the table."""

    viewer: bool = False
    """Show one robot in MuJoCo's viewer, until its window is closed, and write nothing."""

    overwrite: bool = False
    """Replace an existing video."""

    def run(self) -> int:
        """Roll the policy, print the table, and write the video."""
        if self.viewer and (self.no_video or self.output):
            raise ConfigError("--viewer writes no video; --output and --no-video are of no use")
        if not (self.viewer or self.no_video):
            require_training("imageio_ffmpeg")  # before the wait
        run = self.open()
        target = Path(self.output or f"{run.folder.resolve().name}.mp4")
        asked = self.asked(self.seconds)
        from terrainkit_robots.policy.play import play, view
        from terrainkit_robots.rendering.video import check_video_path, check_video_size

        if self.viewer:
            view(run, asked)
            return 0
        if not self.no_video:
            check_video_size(self.size)
            check_video_path(target, overwrite=self.overwrite)  # before the wait
        with render.steps() as steps:
            played = play(
                run,
                asked,
                filmed=not self.no_video,
                robots=self.robots,
                size=self.size,
                progress=lambda done: steps.say(f"robots walk: {done:.0%} of {self.seconds:g} s"),
            )
        render.result(headline(played.evaluation))
        render.table(rows(played.evaluation))
        if played.film is not None:
            self._write(played.film, target)
        return 0

    def _write(self, film: "VideoSpec", target: Path) -> None:
        from terrainkit_robots.rendering.video import write_video

        frames = write_video(film, target, overwrite=self.overwrite)
        for _ in render.progress(frames, film.num_frames, of="frames"):
            pass
        size = target.stat().st_size / 1e6
        render.result(f"wrote {target}: {film.num_frames / film.fps:.1f} s, {size:.1f} MB")


def rows(found: "Evaluation") -> list[tuple[str, ...]]:
    """Return how robots did on each terrain of a map, as the rows of a table; none on a plane."""
    if not found.by_terrain:
        return []
    levels = sorted({part.level for part in found.by_level if part.level is not None})
    success = {
        (part.terrain, part.level): part.score.success for part in found.by_terrain_and_level
    }
    head = ["terrain", "robots", "fell", "m/s", "rad/s", "success"]
    table = [(*head, *(f"level {level}" if level == levels[0] else str(level) for level in levels))]
    for part in found.by_terrain:
        score = part.score
        cells = [
            str(part.terrain),
            str(score.robots),
            str(score.falls),
            number(score.lin_vel_error),
            number(score.ang_vel_error),
            _share(score.success),
        ]
        by_level = [_share(success.get((part.terrain, level))) for level in levels]
        table.append((*cells, *by_level))
    return table


def _share(value: float | None) -> str:
    return "-" if value is None else f"{value:.0%}"
