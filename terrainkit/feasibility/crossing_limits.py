"""RobotLimits: what a robot can cross, one number per quantity."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Self

from msgspec import Meta

from terrainkit.errors import ConfigError
from terrainkit.settings.schema import Config, field_types
from terrainkit.settings.text import expected_names
from terrainkit.settings.type_hint import MAX_VALUE, convert

Limit = Annotated[float, Meta(gt=0, le=MAX_VALUE)]

# Of the values on one half of a grid over each dimension, those that agree most often with whether
# `quadruped_map` and `quadruped_hard` cross; the easiest of several. Steps up and gaps stay as they
# are, since no other value agrees more often. benchmarks/results/feasibility.md has the grid.
_WALKING = {"step_down": 1.25, "slope": 0.64, "foothold": 3.2}
"""Walking limits, in limits of the robot."""

_MAX_WALKING_FOOTHOLD = 0.28
"""Foothold to which the margin extends, at most [m]: treads of stairs are footholds."""

_WALKING_CLEARANCES = (1.3, 1.05)
"""Clearances below which walking demands something, and above which robots walk upright, in
standing heights. The policies do not crouch, and the body moves up and down."""

_WALKING_YAW = 0.45
"""Angle between a walking body and the passage [rad], so that the length of the body counts."""


@dataclass(frozen=True, kw_only=True)
class RobotLimits(Config):
    """The limits of a robot. Each quantity of a path is divided by its limit.

    Raises:
        ConfigError: if a limit is not above 0, or the crouched height is not below the standing
            height.
    """

    step_up: Limit
    """Highest step up [m]; higher ground is a wall."""

    step_down: Limit
    """Highest step down [m]."""

    gap: Limit
    """Widest gap between two footholds, from edge to edge [m]."""

    slope: Limit
    """Steepest slope, as rise over run."""

    foothold: Limit
    """Diameter of the smallest foothold [m]."""

    body_width: Limit
    """Width of the narrowest passage [m]."""

    standing_height: Limit
    """Clearance under which the robot walks upright [m]."""

    crouched_height: Limit
    """Lowest clearance under which the robot walks [m]."""

    friction: Limit = 2 / 3
    """Largest share of the friction coefficient that a slope takes, as rise over run divided by the
    coefficient. A foot slides above 1; the rest is for the horizontal forces of walking."""

    body_length: Limit | None = None
    """Length of the body [m]; None if it is as long as it is wide. Only walking limits need it."""

    turning_width: Limit | None = None
    """Width of the narrowest passage that is longer than the body [m]; None for `body_width`, or
    in the walking limits for the diagonal of the body."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.crouched_height >= self.standing_height:
            raise ConfigError(
                f"crouched_height: got {self.crouched_height:g} m; expected less than the "
                f"standing_height of {self.standing_height:g} m"
            )
        if self.turning_width and self.turning_width > 2 * self.body_width:
            raise ConfigError(
                f"turning_width: got {self.turning_width:g} m; expected at most twice the "
                f"body_width of {self.body_width:g} m"
            )

    def walking(self) -> Self:
        """Return the limits of the walking demand, with the margins that walking robots need.

        In a passage that is longer than the body, the robot needs room to turn: the diagonal of its
        body.
        """
        length = self.body_length or self.body_width
        upright, lowest = _WALKING_CLEARANCES
        factors = {name: factor * getattr(self, name) for name, factor in _WALKING.items()}
        foothold = max(self.foothold, min(factors.pop("foothold"), _MAX_WALKING_FOOTHOLD))
        width = self.body_width * math.cos(_WALKING_YAW) + length * math.sin(_WALKING_YAW)
        diagonal = math.hypot(length, self.body_width)
        return replace(
            self,
            foothold=foothold,
            body_length=length,
            body_width=width,
            turning_width=self.turning_width or min(diagonal, 2 * width),
            standing_height=upright * self.standing_height,
            crouched_height=lowest * self.standing_height,
            **factors,
        )


def limit_overrides(values: Mapping[str, object]) -> dict[str, float]:
    """Return limits by name, converted to numbers.

    Args:
        values: Values by name of the limit, as numbers or text.

    Raises:
        ConfigError: if a name is no limit, or a value is not above 0.
    """
    hints = field_types(RobotLimits)
    for name in values:
        if name not in hints:
            raise ConfigError(f"no limit {name!r}; {expected_names(name, hints, 'limits are')}")
    return {name: convert(name, value, hints[name]) for name, value in values.items()}
