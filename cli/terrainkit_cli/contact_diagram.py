"""Draw which feet are in contact over time."""

from collections.abc import Mapping

import numpy as np

ROW_HEIGHT, LABEL_WIDTH, STEP_WIDTH = 24, 180, 8
"""Sizes in a contact diagram [pixels]."""


def draw_contacts(contacts: Mapping[str, str], dt: float) -> bytes:
    """Return a contact diagram as a PNG: one row per foot, black while it is in contact.

    Args:
        contacts: Contacts of each foot, by name: one character per step, 1 in contact.
        dt: Time between steps [s].
    """
    import cv2

    rows = np.array([[character == "1" for character in text] for text in contacts.values()])
    cell = np.zeros((ROW_HEIGHT, STEP_WIDTH))
    cell[4:-4] = 1
    blocks = np.kron(rows, cell)
    image = np.full((len(blocks) + ROW_HEIGHT, LABEL_WIDTH + blocks.shape[1]), 255, np.uint8)
    image[: len(blocks), LABEL_WIDTH:][blocks > 0] = 0
    labels = [*contacts, f"{rows.shape[1] * dt:.2f} s"]
    for row, label in enumerate(labels):
        at = (8, ROW_HEIGHT * (row + 1) - 7)
        cv2.putText(image, label, at, cv2.FONT_HERSHEY_SIMPLEX, 0.45, 0, 1, cv2.LINE_AA)
    return bytes(cv2.imencode(".png", image)[1])
