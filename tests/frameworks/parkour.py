"""The map of most checks, and where balls come to rest on its ground and its solids."""

import os

import numpy as np

import terrainkit

RADIUS = 0.1
"""Radius of the balls [m]."""

PRESET = os.environ.get("TERRAINKIT_PRESET", "parkour")
WIDTH = 6.0 if PRESET == "parkour" else 8.0
CONFIG = terrainkit.MapConfig(rows=4, cols=7, patch_size=(8.0, WIDTH), border=5.0, preset=PRESET)

_DROP = 0.02
"""Initial distance of the balls from the surface below [m]."""


def ball_starts(terrain_map, num_on_ground=8, num_on_solids=8):
    """Return the initial positions of balls over spawn positions and boxes [m], shape (n, 3)."""
    solids = terrain_map.solids
    boxes = solids.boxes[solids.collides[: len(solids.boxes)]].astype(float)
    is_level = np.abs(boxes[:, 7:9]).max(axis=1) < 1e-3
    tops = boxes[is_level & (boxes[:, 3:5] > 0.05).all(axis=1)][:, :3]
    tops[:, 2] = terrain_map.scan(np.add(tops, [0, 0, 20]))
    tops = tops[tops[:, 2] > terrain_map.height(tops[:, :2]) + 0.2]
    tops = tops[np.argsort(tops[:, 2], kind="stable")]
    origins = terrain_map.env_origins.reshape(-1, 3)
    surface = [
        each[np.linspace(0, len(each) - 1, number, dtype=int)]
        for each, number in ((origins, num_on_ground), (tops, num_on_solids))
    ]
    return np.add(np.concatenate(surface), [0, 0, RADIUS + _DROP])


def rest_error(terrain_map, starts, positions):
    """Return the largest distance of balls [m] from where they touch the surface of the map."""
    expected = terrain_map.scan(starts) + RADIUS
    return float(np.abs(np.asarray(positions, float)[:, 2] - expected).max())
