import dataclasses
from dataclasses import dataclass

import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ConfigError
from terrainkit.terrain import parameter
from terrainkit.terrain.overlay import Overlay


@dataclass(frozen=True, kw_only=True)
class Lift(Overlay):
    """A higher ground."""

    height: float = parameter.height(0.1, 0.5)
    number: int = parameter.count(1, 5)
    mode: str = parameter.choice("up", "down")

    def apply(self, patch, rng):  # noqa: ARG002
        return dataclasses.replace(patch, heights=patch.heights + self.height)


def test_overlay_defaults_are_ranges():
    assert Lift().requested() == {"height": (0.1, 0.5), "number": (1, 5), "mode": "up"}
    assert Lift().at(0.5).requested() == {"height": 0.3, "number": 3, "mode": "up"}
    assert Lift(height=0.2).at(1.0) == Lift(height=0.2, number=5)
    assert Lift(height=[0, 1]) == Lift(height=(0.0, 1.0))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"height": (1, 2, 3)}, r"lift\.height: got \[1, 2, 3\]; expected one value or a pair"),
        ({"mode": ("up", "down")}, r"lift\.mode: got \['up', 'down'\]; expected one value"),
    ],
)
def test_overlay_parameters_are_checked(given, message):
    with pytest.raises(ConfigError, match=message):
        Lift(**given)


def test_own_overlay_is_applied_to_every_row():
    flat = SubTerrain(terrain="flat", overlays=(Lift(), Lift(height=1.0)))
    terrain_map = generate(MapConfig(rows=3, cols=1, border=0.0, terrains=(flat,)))
    heights = np.stack([terrain_map.patch(row, 0).heights for row in range(3)])
    assert heights == pytest.approx(np.full((80, 80, 3), [1.1, 1.3, 1.5]).T)
    assert terrain_map.env_origins[:, 0, 2] == pytest.approx([1.1, 1.3, 1.5])
    assert terrain_map.parameters[1, 0].requested["overlays[0].height"] == pytest.approx(0.3)
