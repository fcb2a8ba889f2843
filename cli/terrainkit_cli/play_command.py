"""The command that plays a policy."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from terrainkit_cli import render
from terrainkit_cli.argument_types import OutputPath
from terrainkit_cli.evaluate_command import PolicyCommand, gait_lines, result_rows, summary_line
from terrainkit_cli.parse import option
from terrainkit_cli.training_extra import require_training

if TYPE_CHECKING:
    from terrainkit_robots.rendering.video import VideoSpec


@dataclass(frozen=True, kw_only=True)
class Play(PolicyCommand):
    """Record a video of a policy, and print its errors and falls.

    On a plane, the robots walk in formation, with --command or a sequence of commands. On a map,
    one robot walks on each patch, and the video follows some of them on different terrains.
    """

    seconds: float = 12.0
    """Duration of the rollout and of the video [s]."""

    output: OutputPath | None = None
    """The video to write; by default RUN.mp4 in the working directory."""

    robots: int = 4
    """On a map, number of robots that the video follows in turn."""

    size: Annotated[tuple[int, int], option("WIDTH HEIGHT")] = (640, 360)
    """Size of the video [pixels]."""

    video: bool = True
    """Write a video; --no-video only prints the table."""

    overwrite: bool = False
    """Replace an existing video."""

    def run(self) -> int:
        """Roll out the policy, print the table, and write the video."""
        if self.video:
            require_training("imageio_ffmpeg")  # before the rollout
        spec = self.load_spec()
        from terrainkit_robots.rl.run import Run

        if isinstance(spec, Run):
            named = spec.folder.resolve().name
        else:
            assert self.policy is not None
            named = self.policy.stem
        target = self.output or Path(f"{named}.mp4")
        config = self.eval_config(self.seconds)
        from terrainkit_robots.policy.play import play
        from terrainkit_robots.rendering.video import check_video_path, check_video_size

        if self.video:
            check_video_size(self.size)
            check_video_path(target, overwrite=self.overwrite)  # before the rollout
        with render.steps() as steps:
            result = play(
                spec,
                config,
                video=self.video,
                robots=self.robots,
                size=self.size,
                progress=lambda fraction: steps.update(
                    f"rollout: {fraction:.0%} of {self.seconds:g} s"
                ),
            )
        render.result("\n".join([summary_line(result.evaluation), *gait_lines(result.evaluation)]))
        render.table(result_rows(result.evaluation))
        if result.video is not None:
            self._write(result.video, target)
        return 0

    def _write(self, video: "VideoSpec", target: Path) -> None:
        from terrainkit_robots.rendering.video import write_video

        frames = write_video(video, target, overwrite=self.overwrite)
        for _ in render.progress(frames, video.num_frames, of="frames"):
            pass
        size = target.stat().st_size / 1e6
        render.result(f"wrote {target}: {video.num_frames / video.fps:.1f} s, {size:.1f} MB")
