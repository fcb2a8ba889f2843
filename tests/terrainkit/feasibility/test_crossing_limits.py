import re
from dataclasses import replace

import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.feasibility.crossing_limits import RobotLimits, limit_overrides
from terrainkit.feasibility.foothold_graph import ratio
from tests.limits import LIMITS

VALUES = vars(LIMITS)


@pytest.mark.parametrize("value", [0.0, float("nan"), 1.001e6, "0.2", True])
@pytest.mark.parametrize("name", VALUES)
def test_limits_reject_values_that_are_not_above_0(name, value):
    with pytest.raises(ConfigError, match=rf"^{name}: got "):
        RobotLimits(**VALUES | {name: value})
    with pytest.raises(ConfigError, match=rf"^{name}: got "):
        limit_overrides({name: value})
    assert limit_overrides({name: 1}) == {name: 1.0}


def test_crouched_height_is_below_standing_height():
    with pytest.raises(ConfigError, match=r"crouched_height: got 0\.6 m; expected less than"):
        RobotLimits(**VALUES | {"crouched_height": 0.6})


def test_walking_limits_by_hand():
    """A body of 0.4 m x 0.3 m turns in 0.5 m, and one without a length in sqrt(2) x 0.4 m."""
    walking = replace(LIMITS, body_length=0.3).walking()
    assert (walking.turning_width, walking.step_up, walking.gap) == pytest.approx((0.5, 0.2, 0.4))
    assert walking.step_down == pytest.approx(1.25 * 0.25)
    # The margin of footholds ends at treads of stairs.
    footholds = [replace(LIMITS, foothold=size).walking().foothold for size in (0.05, 0.1, 0.3)]
    assert footholds == pytest.approx([0.16, 0.28, 0.3])
    assert 0.4 < walking.body_width < 0.5
    assert LIMITS.walking().turning_width == pytest.approx(0.4 * 2**0.5)
    # Robots do not walk upright where they just fit: below 1.05 x 0.6 m, the demand is above 1.
    clearances = np.array([0.78, 0.63, 0.6])
    assert ratio("crouched_height", clearances, walking) == pytest.approx([0.0, 1.0, 1.2])
    assert ratio("crouched_height", clearances, LIMITS) == pytest.approx(0.0)


def test_unknown_limit_lists_the_known_ones():
    listed = f"no limit 'stepup'; did you mean 'step_up'? Limits are: {', '.join(VALUES)}"
    with pytest.raises(ConfigError, match=f"^{re.escape(listed)}$"):
        limit_overrides({"stepup": 0.2})
