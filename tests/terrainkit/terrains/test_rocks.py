from terrainkit.terrains.rocks import Rocks
from tests.terrains import solids_of


def test_rocks_are_hulls_within_their_radius():
    solids = solids_of(Rocks(height=0.6, min_radius=0.2, max_radius=0.6, amplitude=0.0))
    lower, upper = solids.bounds()
    width = (upper - lower)[:, :2].max(axis=1)
    assert len(solids.hull_counts) == len(solids) > 10
    assert width.max() <= 1.2
    assert width.min() >= 0.2  # 16 random points nearly always span half of the diameter
    assert upper[:, 2].max() <= 0.6
    assert lower[:, 2].max() < 0
