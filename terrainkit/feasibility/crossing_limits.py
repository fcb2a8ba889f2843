"""RobotLimits: what a robot can cross, one number per quantity."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from msgspec import Meta

from terrainkit.errors import ConfigError
from terrainkit.settings.schema import Config, field_types
from terrainkit.settings.text import expected_names
from terrainkit.settings.type_hint import MAX_VALUE, convert

Limit = Annotated[float, Meta(gt=0, le=MAX_VALUE)]


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

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.crouched_height >= self.standing_height:
            raise ConfigError(
                f"crouched_height: got {self.crouched_height:g} m; expected less than the "
                f"standing_height of {self.standing_height:g} m"
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
