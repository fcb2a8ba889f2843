import re

import pytest

from terrainkit.errors import ConfigError
from terrainkit.feasibility.crossing_limits import RobotLimits, limit_overrides
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


def test_unknown_limit_lists_the_known_ones():
    listed = f"no limit 'stepup'; did you mean 'step_up'? Limits are: {', '.join(VALUES)}"
    with pytest.raises(ConfigError, match=f"^{re.escape(listed)}$"):
        limit_overrides({"stepup": 0.2})
