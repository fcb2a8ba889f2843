"""An mp4 that is written frame by frame, in H.264, which plays everywhere.

ffmpeg writes it, the one that the package imageio-ffmpeg brings or finds.
"""

import subprocess
import tempfile
from fractions import Fraction
from pathlib import Path
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import TerrainkitError
from terrainkit_robots.text import short

QUALITY = 23
"""The rate factor of x264: 18 cannot be told from the original, 28 is blurred."""

_PATIENCE = 60.0
"""Once it has every frame, ffmpeg may take so long [s]."""

_MOST_WORDS = 160


class Mp4Error(TerrainkitError):
    """The video cannot be written; says why in one line."""


class Mp4Writer:
    """A video that is being written; what is left of one that fails is no video."""

    def __init__(self, path: Path, size: tuple[int, int], fps: float) -> None:
        """Begin it.

        Args:
            path: Where to write; what is there is replaced.
            size: Width and height, both even.
            fps: Frames per second.

        Raises:
            Mp4Error: if there is no ffmpeg, or it does not run.
        """
        width, height = size
        shown = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}"]
        rate = ["-r", str(Fraction(fps).limit_denominator(1001))]
        coded = ["-c:v", "libx264", "-preset", "veryfast", "-crf", str(QUALITY)]
        # The colors that every player knows, and the index in front, so that it plays at once.
        plain = ["-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4"]
        words = ["-nostdin", "-y", "-loglevel", "error", *shown, *rate, "-i", "-", *coded, *plain]
        # Into a file: a pipe that nobody reads would stop it when it is full.
        self._complaints = tempfile.TemporaryFile()  # noqa: SIM115
        try:
            self._process = subprocess.Popen(
                [_ffmpeg(), *words, str(path)],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=self._complaints,
            )
        except BaseException as error:
            self._complaints.close()
            if isinstance(error, OSError):
                raise Mp4Error(f"ffmpeg does not run: {error}") from None
            raise

    def write(self, picture: NDArray[np.uint8]) -> None:
        """Add a frame in red, green and blue, shape (height, width, 3).

        Raises:
            Mp4Error: if ffmpeg has ended.
        """
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(np.ascontiguousarray(picture).data)
        except OSError:
            raise self._failure() from None

    def __enter__(self) -> "Mp4Writer":
        """Return it."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Finish the video; or, after an error, end ffmpeg as it is.

        Raises:
            Mp4Error: if it could not be written whole.
        """
        try:
            if kind is None:
                self._finish()
        finally:
            self._process.kill()
            self._close()
            self._process.wait()
            self._complaints.close()

    def _finish(self) -> None:
        whole = self._close()
        try:
            code = self._process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            raise Mp4Error("ffmpeg did not finish the video in time") from None
        if code or not whole:
            raise self._failure()

    def _close(self) -> bool:
        """Tell ffmpeg that there are no more frames, and return whether it took all."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.close()
        except OSError:
            return False
        return True

    def _failure(self) -> Mp4Error:
        try:
            code = self._process.wait(1.0)
        except subprocess.TimeoutExpired:
            return Mp4Error("ffmpeg takes no more frames")
        self._complaints.seek(0)
        lines = self._complaints.read(10_000).decode(errors="replace").splitlines()
        said = " ".join(lines[0].split()) if lines else f"it ended with code {code}"
        return Mp4Error(f"ffmpeg: {short(said, _MOST_WORDS)}")


def _ffmpeg() -> str:
    """Return the program."""
    try:
        import imageio_ffmpeg

        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except (ImportError, RuntimeError) as error:
        said = short(" ".join(str(error).split()), _MOST_WORDS)
        raise Mp4Error(f"{said}: pip install 'terrainkit[train]'") from None
