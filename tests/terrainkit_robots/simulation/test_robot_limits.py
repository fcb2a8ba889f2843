from pathlib import Path

import pytest

from terrainkit.errors import ConfigError
from terrainkit_robots.description import bundled
from terrainkit_robots.simulation.robot_limits import derive_limits
from tests.tables import read_table

FOLDER = Path(bundled.__file__).parent


def test_limits_of_the_quadruped_by_hand():
    """Legs of 0.448 m, feet of 0.022 m, and 0.328 m from hip to hip; it stands 0.4 m high."""
    derived = derive_limits(FOLDER / "quadruped")
    expected = read_table(__file__, "limits_of_the_quadruped_by_hand")
    # The pose may change.
    assert vars(derived.limits) == pytest.approx(expected | {"turning_width": None}, abs=5e-3)
    assert set(derived.reasons) == set(expected)
    assert derived.reasons["step_up"] == "0.4 x leg_length (0.448 m)"


def test_overrides_replace_derived_limits():
    derived = derive_limits(FOLDER / "biped", {"gap": 0.25})
    assert (derived.limits.gap, derived.reasons["gap"]) == (0.25, "given")
    with pytest.raises(ConfigError, match=r"step_up: got -1\.0"):
        derive_limits(FOLDER / "biped", {"step_up": -1.0})
