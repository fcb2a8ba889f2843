"""The progress of training, as those who watch it see it after each iteration."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, kw_only=True)
class Progress:
    """How training goes. Means are those of the last 100 episodes, or of the last ones known."""

    folder: Path | None
    """Where checkpoints and curves go."""

    iteration: int
    """Updates so far."""

    last: int
    """Updates after which training ends."""

    steps_per_second: float
    """Steps of environments per second, learning included [1/s]."""

    learning: float
    """Part of the time that goes into learning, 0 to 1."""

    remaining: float
    """Time until the end, going on like this [s]."""

    reward: float | None
    """Mean sum of rewards of an episode; None before the first has ended."""

    episode_length: float | None
    """Mean length of an episode [s]; None before the first has ended."""

    noise_std: float
    """Mean standard deviation of the actions."""

    rewards: Mapping[str, float]
    """Mean reward per second of each term."""

    levels: Mapping[str, float]
    """Mean level of the robots on each terrain; empty on a plane."""

    success: Mapping[str, float]
    """Success rate of late on each terrain, 0 to 1."""


Watch = Callable[[Progress], None]


def nobody(_progress: Progress) -> None:
    """Watch nothing."""
