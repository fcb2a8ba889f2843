"""The verdict: whether a robot that was simulated stood, and if not, what was wrong."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from terrainkit_robots.simulation.standing import Standing
from terrainkit_robots.text import names

_UPRIGHT, _LEANING, _FALLEN = map(math.radians, (3, 9, 29))
"""Tilt of one that stands, that leans, and of one that fell [rad]: more than 3 degrees is seen in
what a policy observes, from 9 on a robot sits or hangs over, and from 29 on none comes back."""

_SUNK, _COLLAPSED = 0.25, 0.5
"""Loss of height over leg length: from a quarter on it squats, from a half on it lies, or fell
through the floor."""

_DRIFTED = 0.25
"""Way of the base over leg length; feet that hold let it move by a tenth."""

_SATURATED = 0.95
"""Share of its effort that a joint has to give all the time."""

_MOST_NAMES = 4


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """Whether a robot stood."""

    faults: tuple[str, ...]
    """What was wrong, each with the number and its limit; empty if it stood."""

    degree: int
    """How wrong: 0, it stood or leans a little; 1, it stands badly; 2, it fell or blew up."""

    @property
    def stands(self) -> bool:
        """Whether nothing was wrong."""
        return not self.faults


def judge(standing: Standing) -> Verdict:
    """Return whether a robot stood.

    That is: upright, at its height and place, on all of its feet and on nothing else, by less than
    its motors have.
    """
    if standing.blew_up:
        fault = f"its state blew up after {standing.seconds:.2f} s"
        return Verdict(faults=(fault,), degree=2)
    found = list(_faults(standing))
    return Verdict(
        faults=tuple(text for _, text in found), degree=max((much for much, _ in found), default=0)
    )


def _faults(standing: Standing) -> Iterator[tuple[int, str]]:
    """Yield what was wrong, and how much."""
    tilt, length = standing.tilt, standing.leg_length
    if tilt > _UPRIGHT:
        degrees, most = math.degrees(tilt), math.degrees(_UPRIGHT)
        yield (
            (tilt > _LEANING) + (tilt > _FALLEN),
            f"it tilts by {degrees:.1f} degrees; wanted at most {most:g}",
        )
    if standing.sink > _SUNK * length:
        yield (
            1 + (standing.sink > _COLLAPSED * length),
            f"its base sinks by {standing.sink:.3f} m; wanted at most {_SUNK * length:.3f}",
        )
    if standing.drift > _DRIFTED * length:
        yield (
            1,
            f"it drifts by {standing.drift:.3f} m; wanted at most {_DRIFTED * length:.3f}",
        )
    if standing.touching:
        touch = "touches" if len(standing.touching) == 1 else "touch"
        yield 1, f"{_listed(standing.touching)} {touch} the ground; wanted feet alone"
    if standing.lifted:
        hang = "does" if len(standing.lifted) == 1 else "do"
        yield 1, f"{_listed(standing.lifted)} {hang} not touch the ground; wanted every foot"
    if standing.saturation > _SATURATED:
        share = f"{standing.saturation:.0%} of its effort; wanted at most {_SATURATED:.0%}"
        yield 1, f"{standing.saturated} gives {share}"


def _listed(bodies: tuple[str, ...]) -> str:
    more = len(bodies) - _MOST_NAMES
    return names(bodies[:_MOST_NAMES]) + (f" and {more} more" if more > 0 else "")
