import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate


def clearance(parameters, difficulty, patch_size=(8.0, 8.0)):
    config = MapConfig(
        rows=1,
        cols=1,
        patch_size=patch_size,
        mode="selected",
        selected_difficulty=difficulty,
        border=0.0,
        terrains=(SubTerrain(terrain="ceiling", parameters=parameters),),
    )
    return generate(config).clearance


@pytest.mark.parametrize(("difficulty", "expected"), [(0.0, 0.5), (0.5, 0.35), (1.0, 0.2)])
def test_ceiling_surrounds_the_platform(difficulty, expected):
    # The platform ends 1 m from the center, and the ceiling 3 m from it.
    free = clearance({}, difficulty)
    angle = np.linspace(0.0, 2 * np.pi, 50)
    direction = np.column_stack([np.cos(angle), np.sin(angle)])
    direction /= np.abs(direction).max(axis=1, keepdims=True)
    assert np.isinf(free(4.0 + 0.99 * direction)).all()
    assert free(4.0 + 1.01 * direction) == pytest.approx(expected)
    assert free(4.0 + 2.99 * direction) == pytest.approx(expected)
    assert np.isinf(free(4.0 + 3.01 * direction)).all()


def test_ceiling_ends_at_the_edge_of_the_patch():
    free = clearance({}, 1.0, (8.0, 4.0))
    assert free([[4.0, 0.01], [4.0, 3.99]]) == pytest.approx(0.2)


def test_ceiling_beside_platform_as_wide_as_patch():
    free = clearance({"platform": 2.0}, 1.0, (8.0, 2.0))
    assert free([[2.5, 1.0], [5.5, 0.1]]) == pytest.approx(0.2)
    assert np.isinf(free([[4.0, 0.01], [4.0, 1.99]])).all()
