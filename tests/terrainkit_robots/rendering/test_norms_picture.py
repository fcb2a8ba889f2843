import cv2
import numpy as np

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.rendering.norms_picture import draw_norms
from tests.robots import QUADRUPED


def red_pixels(text, folder):
    """Return how many pixels of the picture of a robot are red, of unusual values."""
    file = folder / "robot.urdf"
    file.write_text(text)
    picture = draw_norms(Facts(load_robot(file)))
    image = cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_COLOR).astype(int)
    return int(((image[..., 2] > 180) & (image[..., :2].max(axis=2) < 90)).sum())


def test_unusual_values_are_red(tmp_path):
    text = QUADRUPED.read_text()
    assert red_pixels(text, tmp_path) == 0
    assert red_pixels(text.replace('effort="23.7"', 'effort="2370"'), tmp_path) > 100


def test_robot_without_norms_has_an_empty_picture(tmp_path):
    assert red_pixels('<robot name="r"><link name="a"/></robot>', tmp_path) == 0
