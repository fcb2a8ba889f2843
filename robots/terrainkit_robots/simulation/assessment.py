"""Assess whether a simulated robot stood."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from terrainkit_robots.simulation.standing import StandResult
from terrainkit_robots.text import contrast, names

_MAX_TILT, _MAX_LEANING_TILT, _MAX_RECOVERABLE_TILT = map(math.radians, (3, 9, 29))
"""Largest tilt of a standing robot, of a leaning robot, and of a robot that may recover [rad]. More
than 3 degrees changes the observations of a policy. From 9 degrees on, a robot sits or hangs over;
from 29 degrees on, none recovers."""

_MAX_HEIGHT_LOSS, _MAX_RECOVERABLE_HEIGHT_LOSS = 0.25, 0.5
"""Loss of height over leg length: from a quarter on a robot squats, from a half on it lies or has
fallen through the floor."""

_MAX_DRIFT = 0.25
"""Horizontal motion of the base over leg length, at most. Feet that hold allow for a tenth."""

_MAX_SATURATION = 0.95
"""Torque over effort limit of a joint, at most."""

_MAX_NAMES = 4


@dataclass(frozen=True, kw_only=True)
class Assessment:
    """Whether a robot stood."""

    failures: tuple[str, ...]
    """Failed criteria, each with the value and the limit. Empty if it stood."""

    degree: int
    """0: it stood or leans a little. 1: it stands badly. 2: it fell or the simulation diverged."""

    @property
    def stands(self) -> bool:
        """Whether no criterion failed."""
        return not self.failures


def assess(result: StandResult) -> Assessment:
    """Assess whether a robot stood.

    It has to be upright at its height and position, on all of its feet and on nothing else, and
    its joints must not saturate.
    """
    if result.diverged:
        failure = f"its simulation diverged after {result.seconds:.2f} s"
        return Assessment(failures=(failure,), degree=2)
    found = list(_failed_checks(result))
    return Assessment(
        failures=tuple(text for _, text in found),
        degree=max((degree for degree, _ in found), default=0),
    )


def _failed_checks(result: StandResult) -> Iterator[tuple[int, str]]:
    """Yield the degree and the description of each failed criterion."""
    tilt, length = result.tilt, result.leg_length
    if tilt > _MAX_TILT:
        got, expected = contrast(math.degrees(tilt), math.degrees(_MAX_TILT), ".1f")
        yield (
            (tilt > _MAX_LEANING_TILT) + (tilt > _MAX_RECOVERABLE_TILT),
            f"it tilts by {got} deg (expected at most {expected} deg)",
        )
    if result.height_loss > _MAX_HEIGHT_LOSS * length:
        got, expected = contrast(result.height_loss, _MAX_HEIGHT_LOSS * length, ".3f")
        yield (
            1 + (result.height_loss > _MAX_RECOVERABLE_HEIGHT_LOSS * length),
            f"its base sinks by {got} m (expected at most {expected} m)",
        )
    if result.drift > _MAX_DRIFT * length:
        got, expected = contrast(result.drift, _MAX_DRIFT * length, ".3f")
        yield 1, f"it drifts by {got} m (expected at most {expected} m)"
    # A foot without its own link touches the ground beside its tip, such as with the whole shank.
    beside = tuple(foot for foot in result.lifted_feet if foot in result.other_contacts)
    others = tuple(body for body in result.other_contacts if body not in beside)
    lifted = tuple(foot for foot in result.lifted_feet if foot not in beside)
    if beside:
        verb, tip = ("rests", "its tip") if len(beside) == 1 else ("rest", "their tips")
        yield 1, f"{_join(beside)} {verb} on the ground beside {tip} (expected only tips)"
    if others:
        verb = "touches" if len(others) == 1 else "touch"
        yield 1, f"{_join(others)} {verb} the ground (expected only feet)"
    if lifted:
        verb = "does" if len(lifted) == 1 else "do"
        yield 1, f"{_join(lifted)} {verb} not touch the ground (expected all feet)"
    if result.saturation > _MAX_SATURATION:
        got, expected = contrast(result.saturation, _MAX_SATURATION, ".0%")
        effort = f"{got} of its effort limit (expected at most {expected})"
        yield 1, f"{result.saturated_joint} needs {effort}"


def _join(bodies: tuple[str, ...]) -> str:
    more = len(bodies) - _MAX_NAMES
    return names(bodies[:_MAX_NAMES]) + (f" and {more} more" if more > 0 else "")
