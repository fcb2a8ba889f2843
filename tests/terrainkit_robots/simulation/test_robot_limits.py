import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from terrainkit.errors import ConfigError
from terrainkit_robots.description import bundled
from terrainkit_robots.simulation.robot_limits import derive_limits
from terrainkit_robots.spec.robot_arrays import SPEC_FILE
from terrainkit_robots.spec.robot_spec import RobotSpec
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


def test_a_robot_of_which_only_the_feet_collide_has_the_size_of_its_visual_shapes(
    quadruped_of_feet,
):
    expected = derive_limits(FOLDER / "quadruped").limits
    limits = derive_limits(quadruped_of_feet.folder).limits
    assert limits.standing_height == pytest.approx(expected.standing_height, abs=0.01)
    assert limits.body_width == pytest.approx(expected.body_width, abs=0.01)


def test_wheels_limit_steps_gaps_and_slopes(tmp_path):
    """Wheels of 0.022 m with a track of 0.2 m; the mass is about 0.3 m above the ground."""
    source = FOLDER / "quadruped"
    spec = replace(RobotSpec.load(source / SPEC_FILE), stiffness={".*": 0.0}, stance_width=0.2)
    (tmp_path / SPEC_FILE).write_text(spec.to_toml())
    shutil.copy(source / spec.mjcf, tmp_path)
    limits = derive_limits(tmp_path).limits
    assert (limits.step_up, limits.step_down, limits.gap, limits.foothold) == (0.022,) * 4
    assert limits.slope == pytest.approx(0.1 / 0.3, rel=0.2)
