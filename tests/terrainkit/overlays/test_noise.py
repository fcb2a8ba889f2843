from dataclasses import replace

import numpy as np
import pytest

from terrainkit.features.value_noise import ValueNoise
from terrainkit.geometry.solids import make_boxes
from terrainkit.overlays.noise import Noise


def heights_of(noise, patch):
    return noise.apply(patch, np.random.default_rng(1)).heights


@pytest.mark.parametrize("pattern", ["uniform", "perlin"])
def test_noise_fills_its_amplitude_and_scales_with_the_difficulty(geometry, pattern):
    noise = Noise(amplitude=(0.0, 0.2), pattern=pattern, spacing=0.4)
    none, half, full = (heights_of(noise.at(d), geometry()) for d in (0.0, 0.5, 1.0))
    assert full.dtype == np.float32
    assert 0.15 < np.abs(full).max() <= 0.2
    assert full.min() < -0.1 < 0.1 < full.max()
    assert 2 * half == pytest.approx(full, abs=1e-7)
    assert not none.any()
    # Within 0.4 m, uniform noise is linear, and hills are not.
    assert (np.abs(np.diff(full[0, :4], n=2)).max() < 1e-6) == (pattern == "uniform")


def test_noise_is_added_to_the_ground(geometry):
    patch = geometry(heights=np.ones((40, 40), np.float32))
    added = ValueNoise(amplitude=0.2, step=0.0, spacing=0.2)
    expected = 1.0 + added.heights(patch.grid, np.random.default_rng(1))
    assert heights_of(Noise(amplitude=0.2), patch)[0] == pytest.approx(expected[0])


@pytest.mark.parametrize(
    ("platform", "radius", "cells"), [(2.0, 0.5, 10), (2.0, 0.9, 11), (0.0, 0.8, 10)]
)
def test_noise_fades_to_the_platform_or_two_cells_beyond_the_spawn_disk(
    geometry, platform, radius, cells
):
    noise = Noise(amplitude=0.2, platform=platform, spacing=0.4)
    near = heights_of(noise, geometry(spawn=(11.5, 22.0), spawn_radius=radius))
    full = heights_of(replace(noise, platform=0.0), geometry(spawn=(10.0, 20.0), spawn_radius=0.0))
    # The spawn is between the cells 14 and 15, and the noise is full after four cells.
    start = 15 + cells
    assert not near[15 - cells : start, 20 - cells : 20 + cells].any()
    fade = np.array([0.125, 0.375, 0.625, 0.875, 1.0])
    assert near[start : start + 5, 20] == pytest.approx(
        fade * full[start : start + 5, 20], abs=1e-6
    )


@pytest.mark.parametrize(
    ("bottom", "top", "is_kept"),
    [(5e-5, 1, True), (2e-4, 1, False), (-1, -5e-5, True), (-1, -2e-4, False)],
)
def test_noise_keeps_the_ground_below_standing_solids(geometry, bottom, top, is_kept):
    solids = make_boxes((13.5, 23.5, (bottom + top) / 2), (0.4, 0.4, top - bottom))
    heights = heights_of(Noise(amplitude=0.2), geometry(solids=solids))
    assert heights[33:37, 33:37].any() != is_kept
    assert heights[30:32, 30:40].any()


@pytest.mark.parametrize(("pattern", "spacing"), [("uniform", 4.0 / 13), ("perlin", 0.3)])
def test_noise_realizes_its_own_parameters_only(geometry, pattern, spacing):
    """Heights are not rounded to steps, and only the intervals of nodes are whole."""
    noise = Noise(amplitude=(0.0, 0.2), pattern=pattern, spacing=0.3, platform=1.0).at(0.5)
    realized = noise.realized(geometry().grid)
    assert realized.pop("spacing") == pytest.approx(spacing)
    assert realized == {"amplitude": 0.1, "pattern": pattern, "platform": 1.0}
