import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ConfigError
from terrainkit.terrains.tunnel import Tunnel


@pytest.mark.parametrize(
    ("difficulty", "clearance", "depth"), [(0.0, 0.5, 1.2), (0.5, 0.35, 1.6), (1.0, 0.2, 2.0)]
)
def test_tunnel_by_hand(difficulty, clearance, depth):
    config = MapConfig(
        rows=1,
        cols=1,
        mode="selected",
        selected_difficulty=difficulty,
        border=0.0,
        terrains=(SubTerrain(terrain="tunnel"),),
    )
    free = generate(config).clearance
    # Slots of 3 m behind a start of 2 m, with a tunnel in the middle of each.
    for middle in (3.5, 6.5):
        for end in (-1, 1):
            x = middle + end * (depth / 2 - 0.01)
            assert free([[x, 4.0], [x, 3.61], [x, 4.39]]) == pytest.approx(clearance)
            assert free([[x, 0.01], [x, 3.59], [x, 4.41], [x, 7.99]]) == pytest.approx(0.0)
            assert np.isinf(free([[x + end * 0.02, 0.01], [x + end * 0.02, 4.0]])).all()


def test_tunnel_goals_lie_behind_the_tunnels(grid, rng):
    terrain = Tunnel.at(1.0)
    heights = terrain.build(grid, rng)
    goals = terrain.goals(grid, heights, rng)
    assert goals[:, :2] == pytest.approx(np.array([[5.0, 4.0], [7.95, 4.0]]))
    lower, upper = terrain.solids(grid, heights, rng).bounds()
    assert upper[:, 2].max() == pytest.approx(0.4)
    assert np.unique(lower[:, 0]) == pytest.approx([2.5, 5.5])


def test_tunnel_rejects_width_of_the_patch(grid, rng):
    with pytest.raises(ConfigError, match="tunnel: got width 8 m; expected less than"):
        Tunnel.at(0.0, {"width": 8.0}).solids(grid, np.zeros(grid.shape, np.float32), rng)
