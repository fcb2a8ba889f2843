import numpy as np
import pytest

from terrainkit.feasibility import assess_map
from terrainkit.integrations.mujoco import make_spec
from terrainkit.terrains.sidewalk import Sidewalk
from tests.limits import LIMITS
from tests.rays import cast_rays
from tests.terrains import map_at, solids_of, tops

PLAIN = {"curb": 0.12, "gutter": 0.04, "grade": 0.1, "ramp_width": 1.0, "flare": 0.2, "trees": 0.0}
"""The curb is at x = 2.3 m, and a curb ramp is 0.16 m / 0.1 = 1.6 m long."""


def ramp_y(terrain_map, x):
    """Return the middle of the curb ramp, the only place at x [m] below the sidewalk."""
    y = np.arange(0.5, 7.5, 0.01) + 0.003
    low = y[tops(terrain_map, x, y) < 0.1199]
    assert np.ptp(low) < 1.4
    return round(low.mean())


def test_sidewalk_curb_gutter_and_ramp_have_their_heights():
    terrain_map = map_at(1.0, "sidewalk", **PLAIN)
    ramp = ramp_y(terrain_map, 2.4)
    assert ramp in {1, 3, 5, 7}
    curb = ramp + (0.8 if ramp < 7 else -0.8)
    x = np.array([1.9, 2.299, 2.301, 4.5, 5.699, 6.699, 6.75, 6.85, 7.2])
    z = [0.0, -0.34, 0.12, 0.12, 0.12, 0.12, -0.04, -0.04, 0.0]
    far = ramp_y(terrain_map, 6.6)
    beside = curb if abs(curb - far) > 0.7 else far + 0.8
    assert tops(terrain_map, x[:4], curb) == pytest.approx(z[:4], abs=1e-4)
    assert tops(terrain_map, x[4:], beside) == pytest.approx(z[4:], abs=1e-4)
    # On the ramp, half way up, at its end, and behind it. The flare rises from the ramp to the
    # sidewalk over 0.2 m.
    on_ramp = tops(terrain_map, np.array([2.301, 3.1, 3.899, 3.95]), ramp + 0.49)
    assert on_ramp == pytest.approx([-0.04, 0.04, 0.12, 0.12], abs=2e-4)
    assert tops(terrain_map, 2.301, ramp + np.array([0.6, 0.701])) == pytest.approx(
        [0.04, 0.12], abs=2e-4
    )


def test_sidewalk_gratings_have_slots():
    terrain_map = map_at(1.0, "sidewalk", **PLAIN | {"slot": 0.02, "trees": 1.0})
    model = make_spec(terrain_map).compile()
    # (0.3 m - 0.02 m) / (0.02 m + 0.03 m) is 6 bars, 0.28 m / 6 - 0.02 m = 0.0267 m wide.
    x = 2.0 + np.arange(0.0005, 0.3, 0.001)
    z = tops(terrain_map, x, 2.5)
    bars = x[z > -0.1]
    rays = cast_rays(model, [(each, 2.5, 1.0) for each in bars])[0]
    assert rays == pytest.approx(np.full(len(bars), -0.04), abs=1e-4)
    assert sorted({*z.round(4).tolist()}) == [-0.34, -0.04]
    is_slot = np.pad((z < -0.1).astype(int), 1)
    first, last = (np.flatnonzero(np.diff(is_slot) == sign) for sign in (1, -1))
    assert len(first) == 7
    assert (last - first) / 1000 == pytest.approx(0.02, abs=1.1e-3)
    # A tree in the middle of a grate of 1 m, 0.2 m behind the curb.
    tree = {1, 3, 5, 7} - {ramp_y_of_trees(terrain_map)}
    y = tree.pop()
    assert tops(terrain_map, 3.0, y) == pytest.approx(0.12 + 2.5, abs=1e-4)
    z = tops(terrain_map, np.arange(2.4, 3.8, 0.001) + 0.0003, y + 0.3)
    is_slot = z < 0.0
    assert np.flatnonzero(is_slot)[[0, -1]] / 1000 + 2.4 == pytest.approx([2.5, 3.5], abs=2e-3)


def ramp_y_of_trees(terrain_map):
    """Return the middle of the slot without a tree."""
    return next(y for y in (1, 3, 5, 7) if tops(terrain_map, 3.0, y) < 1.0)


def test_sidewalk_is_passable_and_its_curb_is_the_step():
    results = [assess_map(map_at(d, "sidewalk", trees=0.0), LIMITS)[0] for d in (0.0, 1.0)]
    assert [each.demand < 1.0 for each in results] == [True, True]
    assert results[0].demand < results[1].demand


def test_sidewalk_every_layout_has_one_ramp_per_curb():
    for seed in range(5):
        # Three slots with poles and one with a ramp on each side.
        solids = solids_of(Sidewalk(trees=0.0), seed)
        assert (len(solids.cylinders), len(solids.hull_counts)) == (6, 6)
