import numpy as np
import pytest

from terrainkit.features.blocks import SINK
from terrainkit.terrains.pallets import Pallets
from tests.terrains import solids_of


@pytest.mark.parametrize(("half", "sides"), [(False, (1.2, 0.8, 0.144)), (True, (0.6, 0.4, 0.116))])
def test_pallets_are_a_deck_on_three_runners(half, sides):
    boxes = solids_of(Pallets.at(0.0, {"half": half, "number": 1})).boxes.astype(float)
    length, width, height = sides
    runners, deck = boxes[:3], boxes[3:]
    top, bottom = boxes[:, 2] + boxes[:, 5], boxes[:, 2] - boxes[:, 5]
    assert top == pytest.approx([*[0.7 * height] * 3, height])
    assert bottom == pytest.approx([*[-SINK] * 3, 0.7 * height])
    assert 2 * runners[:, 3:5] == pytest.approx(np.array([[length, width / 8]] * 3))
    assert 2 * deck[:, 3:5] == pytest.approx(np.array([[length, width]]))
    # The outer sides of the outer runners are flush with the deck.
    outer = np.linalg.norm(runners[0, :2] - runners[2, :2]) + 2 * runners[0, 4]
    assert outer == pytest.approx(width)
    assert runners[1, :2] == pytest.approx(deck[0, :2])
