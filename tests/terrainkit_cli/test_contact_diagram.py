import cv2
import numpy as np

from terrainkit_cli.contact_diagram import draw_contacts


def test_contact_diagram_is_black_in_contact():
    data = np.frombuffer(draw_contacts({"left": "10", "right": "11"}, 0.02), np.uint8)
    image = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE)
    assert image[12, -16:].tolist() == [0] * 8 + [255] * 8
    assert image[36, -16:].tolist() == [0] * 16
