import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.overlays.friction_patches import FrictionPatches


def friction_of(overlay, patch):
    return overlay.apply(patch, np.random.default_rng(0)).friction


def test_friction_patches_are_squares_of_ten_levels(geometry):
    overlay = FrictionPatches(min_friction=0.1, max_friction=1.0)
    friction = friction_of(overlay, geometry((405, 400)))
    assert friction.shape == (405, 400)
    assert friction.dtype == np.float32
    assert np.unique(friction) == pytest.approx(np.linspace(0.1, 1.0, 10))
    squares = friction[:400].reshape(40, 10, 40, 10)
    assert (np.ptp(squares, axis=(1, 3)) == 0).all()
    assert len(np.unique(friction[400:])) > 5  # the rest of the last squares


def test_friction_patches_follow_the_difficulty(geometry):
    easy, hard = (friction_of(FrictionPatches().at(d), geometry()) for d in (0, 1))
    assert (easy.min(), hard.min()) == (np.float32(0.6), np.float32(0.2))
    assert ((easy > hard) | (hard == 1)).all()


def test_friction_patches_accept_equal_but_not_reversed_limits_and_any_side(geometry):
    overlay = FrictionPatches(min_friction=0.5, max_friction=0.5, side=1e6)
    assert (friction_of(overlay, geometry()) == 0.5).all()
    with pytest.raises(ConfigError, match="got min_friction 2 and max_friction 1; expected min_"):
        friction_of(FrictionPatches(min_friction=2.0), geometry())
