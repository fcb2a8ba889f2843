import numpy as np
import pytest

from terrainkit.map.measured_difficulty import MAX_STEP_HEIGHT, measured_difficulty


def ground(rows):
    return np.array(rows, dtype=np.float32)


def test_measured_difficulty_of_level_ground_is_zero():
    assert measured_difficulty(np.full((20, 10), 3.0, dtype=np.float32), 0.1, 3.0) == 0.0


def test_measured_difficulty_of_one_step_by_hand():
    # One cell is a stride. Steps along x: 0.1, 0.1; along y: 0, 0. Heights above 0: 0, 0, 0.1, 0.1.
    assert measured_difficulty(ground([[0, 0], [0.1, 0.1]]), 0.3, 0.0) == pytest.approx(0.05 + 0.05)


def test_measured_difficulty_includes_steps_up_to_limit():
    # Of one cell: 0, 0, 0.3; of two: 0, 0.3; of three: 0.3. Heights above 0: 0, 0, 0, 0.3.
    edge = ground([[0], [0], [0], [0.3]])
    assert measured_difficulty(edge, 0.1, 0.0) == pytest.approx(0.9 / 6 + 0.3 / 4)


def test_measured_difficulty_excludes_longer_steps():
    # Of one cell: 0, 0, 0.3; of two: 0, 0.3; three cells are 0.45 m.
    edge = ground([[0], [0], [0], [0.3]])
    assert measured_difficulty(edge, 0.15, 0.0) == pytest.approx(0.6 / 5 + 0.3 / 4)


@pytest.mark.parametrize("depth", [0.6, 5.0, 1000.0])
def test_measured_difficulty_saturates(depth):
    # Half of the steps and half of the heights are the whole leg.
    edge = ground([[0, 0], [-depth, -depth]])
    assert measured_difficulty(edge, 0.3, 0.0) == pytest.approx(
        MAX_STEP_HEIGHT / 2 + MAX_STEP_HEIGHT / 2
    )


def test_measured_difficulty_is_relative_to_the_spawn():
    # A step of 0.2; from below one of two samples is 0.2 away, from between both are 0.1.
    edge = ground([[0.0], [0.2]])
    assert measured_difficulty(edge, 0.3, 0.0) == pytest.approx(0.2 + 0.1)
    assert measured_difficulty(edge, 0.3, 0.1) == pytest.approx(0.2 + 0.1)
    assert measured_difficulty(edge, 0.3, -0.2) == pytest.approx(0.2 + 0.3)


def test_measured_difficulty_of_a_single_sample():
    assert measured_difficulty(ground([[0.2]]), 0.1, 0.0) == pytest.approx(0.2)


def test_measured_difficulty_grows_with_heights():
    rough = np.random.default_rng(0).uniform(-0.1, 0.1, (30, 20)).astype(np.float32)
    values = [measured_difficulty(rough * scale, 0.1, 0.0) for scale in (0.5, 1.0, 2.0, 4.0)]
    assert values == sorted(values)
    assert values[1] == pytest.approx(2 * values[0])


@pytest.mark.parametrize("turn", [np.transpose, np.flipud, np.fliplr, np.negative])
def test_measured_difficulty_has_no_direction(turn):
    rough = np.random.default_rng(0).uniform(-0.4, 0.4, (30, 20)).astype(np.float32)
    assert measured_difficulty(turn(rough), 0.1, 0.0) == pytest.approx(
        measured_difficulty(rough, 0.1, 0.0)
    )
