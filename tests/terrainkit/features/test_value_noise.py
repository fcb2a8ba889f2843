import numpy as np
import pytest

from terrainkit.features.value_noise import ValueNoise
from terrainkit.geometry.grid import Grid

PLOT = Grid(shape=(60, 40), cell=0.1)


def node_grid(*, spacing=0.2, amplitude=0.05, step=0.005):
    return ValueNoise(spacing=spacing, amplitude=amplitude, step=step)


def noise(*, grid=PLOT, **fields):
    return node_grid(**fields).heights(grid, np.random.default_rng(0))


def test_value_noise_tiny_step_is_continuous():
    assert (noise(step=9e-7) == noise(step=0.0)).all()
    assert (noise(step=1e-6) != noise(step=0.0)).any()


@pytest.mark.parametrize(
    ("amplitude", "step", "largest"),
    [
        (0.3, 0.1, 0.3),  # 0.3 / 0.1 is 2.9999999999999996
        (0.036, 0.005, 0.035),
        (0.05, 0.02, 0.04),
        (0.05, 0.06, 0.0),
        (0.0437, 0.0, 0.0437),
    ],
)
def test_value_noise_amplitude_is_whole_steps(amplitude, step, largest):
    grid = Grid(shape=(200, 200), cell=0.1)
    assert node_grid(amplitude=amplitude, step=step).realized(grid)["amplitude"] == largest
    heights = noise(spacing=0.1, amplitude=amplitude, step=step, grid=grid)
    assert -largest - 1e-9 <= heights.min() <= -0.9 * largest
    assert 0.9 * largest <= heights.max() <= largest + 1e-9


def test_value_noise_has_whole_intervals():
    # 6 m at 2.6 m make two intervals of 3 m, so the ground bends at sample 30 and nowhere else.
    heights = noise(spacing=2.6, step=0.0)
    bends = np.abs(np.diff(heights, 2, axis=0)).max(axis=1) > 1e-12
    assert set(np.flatnonzero(bends)) <= {28, 29}
    assert bends.any()


@pytest.mark.parametrize(
    ("shape", "cell", "asked", "built"),
    [
        ((80, 80), 0.1, 0.25, 0.25),  # between two cells
        ((80, 80), 0.1, 3.0, 2.666666667),  # 2.67 intervals make three
        ((80, 80), 0.1, 3.2, 2.666666667),  # 2.5 make three too
        ((70, 70), 0.05, 0.28, 0.269230769),  # 12.5 make 13; 3.5 / 0.28 is 12.499999999999998
        ((60, 40), 0.1, 2.6, (3.0, 2.0)),  # 2.3 and 1.5
        ((80, 80), 0.1, 20.0, 8.0),
        ((80, 80), 0.1, 0.04, 0.1),  # nodes closer than the cells would never be seen
    ],
)
def test_value_noise_realized_spacing(shape, cell, asked, built):
    grid = Grid(shape=shape, cell=cell)
    assert node_grid(spacing=asked).realized(grid)["spacing"] == built
