import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.overlays.friction_patches import FrictionPatches

RNG = np.random.default_rng


def test_friction_patches_are_squares_of_ten_levels(geometry):
    overlay = FrictionPatches(min_friction=0.1, max_friction=1.0)
    friction = overlay.apply(geometry((405, 400)), RNG(0)).friction
    assert friction.shape == (405, 400)
    assert friction.dtype == np.float32
    assert np.unique(friction) == pytest.approx(np.linspace(0.1, 1.0, 10))
    squares = friction[:400].reshape(40, 10, 40, 10)
    assert (np.ptp(squares, axis=(1, 3)) == 0).all()
    assert len(np.unique(friction[400:])) > 5  # the rest of the last squares


def test_friction_patches_follow_the_difficulty(geometry):
    easy, hard = (FrictionPatches().at(d).apply(geometry(), RNG(0)).friction for d in (0, 1))
    assert (easy.min(), hard.min()) == (np.float32(0.6), np.float32(0.2))
    assert ((easy > hard) | (hard == 1)).all()


def test_friction_patches_reject_reversed_limits(geometry):
    with pytest.raises(ConfigError, match="got min_friction 2 and max_friction 1; expected min_"):
        FrictionPatches(min_friction=2.0).apply(geometry(), RNG(0))


def test_friction_patches_accept_any_side(geometry):
    friction = FrictionPatches(side=1e6).at(1.0).apply(geometry(), RNG(0)).friction
    assert np.ptp(friction) == 0
