import numpy as np
import pytest

from tests.terrains import map_at


@pytest.mark.parametrize(("difficulty", "expected"), [(0.0, 0.5), (0.5, 0.35), (1.0, 0.2)])
def test_ceiling_surrounds_the_platform(difficulty, expected):
    # The platform ends 1 m from the center, and the ceiling 3 m from it.
    free = map_at(difficulty, "ceiling").clearance
    angle = np.linspace(0.0, 2 * np.pi, 50)
    direction = np.column_stack([np.cos(angle), np.sin(angle)])
    direction /= np.abs(direction).max(axis=1, keepdims=True)
    assert np.isinf(free(4.0 + 0.99 * direction)).all()
    assert free(4.0 + 1.01 * direction) == pytest.approx(expected)
    assert free(4.0 + 2.99 * direction) == pytest.approx(expected)
    assert np.isinf(free(4.0 + 3.01 * direction)).all()
