import cv2
import numpy as np
import pytest

from terrainkit.curriculum import PatchStatistics
from terrainkit.curriculum.statistics import add_to_means
from terrainkit.views.curriculum_picture import draw_statistics


def test_statistics_are_recorded_by_patch():
    statistics = PatchStatistics.empty(2, 3)
    progress = np.array([1.0, 0.9, np.nan, np.nan])
    statistics.record(np.array([0, 0, 0, 5]), progress, np.array([3.0, 6.0, 0.0, 2.0]))
    assert statistics.visits.tolist() == [[3, 0, 0], [0, 0, 1]]
    assert statistics.success[0, 0] == 0.5
    assert statistics.returns[0, 0] == 3
    assert statistics.returns[1, 2] == 2
    assert np.isnan(statistics.success).sum() == 5


def test_add_to_means_weights_each_value():
    means = np.array([[0.5, np.nan, 0.25]])
    add_to_means(means, np.array([0, 0, 1]), np.array([1.0, 0.0, 0.75]), decay=0.5)
    # Two values of mean 0.5 have the weight 1 - 0.5^2; the first value of a patch is its mean.
    assert means.tolist() == [[0.5, 0.75, 0.25]]
    add_to_means(means, np.array([0, 0]), np.array([1.0, 1.0]), decay=0.5)
    assert means[0, 0] == pytest.approx(0.25 * 0.5 + 0.75)


def test_picture_colors_cells_by_success():
    statistics = PatchStatistics.empty(3, 2)
    statistics.visits[:] = 12_345
    statistics.success[:, 0] = [1, 0, np.nan]
    names = np.array([["stairs", "gap"]] * 3)
    image = cv2.imdecode(np.frombuffer(draw_statistics(statistics, names), np.uint8), 1)
    colors = {tuple(color) for color in image.reshape(-1, 3).tolist()}
    assert {(96, 168, 58), (62, 62, 201), (225, 225, 225)} <= colors
    assert (96, 168, 58) not in {tuple(c) for c in image[96:].reshape(-1, 3).tolist()}
