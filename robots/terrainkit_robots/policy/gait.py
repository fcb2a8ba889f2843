"""Gait metrics: functions of the contacts, heights and speeds of feet over time.

Arrays have the shape (t, n, f): t steps of n robots with f feet. Contacts are Boolean, and
`measured`, shape (t, n), selects the steps that count.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from terrainkit_robots.transforms import FloatArray

BoolArray = NDArray[np.bool_]

MIN_SWING_STEPS = 2
"""Shorter interruptions of a contact are vibrations, not swings [steps]."""

ROW_HEIGHT, LABEL_WIDTH, STEP_WIDTH = 24, 180, 8
"""Sizes in a contact diagram [pixels]."""


def find_swings(contact: BoolArray, measured: BoolArray) -> tuple[NDArray[np.int64], ...]:
    """Return column (f * robot + foot), takeoff step and touchdown step of every complete swing.

    A swing is complete if its steps and those before and after it are measured.
    """
    steps, _, feet = contact.shape
    known = np.repeat(measured, feet, axis=1).T
    air = known & ~contact.reshape(steps, -1).T
    edges = np.diff(np.pad(air.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    (column, start), stop = np.nonzero(edges == 1), np.nonzero(edges == -1)[1]
    inside = (start > 0) & (stop < steps) & (stop - start >= MIN_SWING_STEPS)
    column, start, stop = column[inside], start[inside], stop[inside]
    complete = known[column, start - 1] & known[column, stop]
    return column[complete], start[complete], stop[complete]


def swing_heights(contact: BoolArray, height: FloatArray, measured: BoolArray) -> FloatArray:
    """Return the mean peak height of the swings of each foot [m], shape (f,); NaN without any."""
    steps, _, feet = contact.shape
    column, start, stop = find_swings(contact, measured)
    bounds = steps * column[:, None] + np.column_stack([start, stop])
    heights = height.reshape(steps, -1).T.ravel()
    peaks = np.maximum.reduceat(heights, bounds.ravel())[::2] if len(column) else np.zeros(0)
    total, count = np.bincount(column % feet, peaks, feet), np.bincount(column % feet, None, feet)
    return np.divide(total, count, out=np.full(feet, np.nan), where=count > 0)


def step_frequency(contact: BoolArray, measured: BoolArray, dt: float) -> float:
    """Return the number of complete swings per foot and second [Hz]; steps are `dt` apart [s]."""
    seconds = dt * measured.sum() * contact.shape[2]
    return len(find_swings(contact, measured)[0]) / seconds if seconds else np.nan


def duty_factors(contact: BoolArray, measured: BoolArray) -> FloatArray:
    """Return the share of the measured time that each foot is in contact, shape (f,)."""
    share: FloatArray = contact[measured].mean(axis=0) if measured.any() else np.nan * contact[0, 0]
    return share


def foot_slip(contact: BoolArray, speed: FloatArray, measured: BoolArray) -> float:
    """Return the mean of the horizontal speed of feet in contact [m/s]; NaN without contact."""
    selected = speed[contact & measured[..., None]]
    return float(selected.mean()) if len(selected) else np.nan


def asymmetry(values: FloatArray, mirror: NDArray[np.int64]) -> float:
    """Return the largest difference between left and right, relative to the mean of both.

    Args:
        values: One number per foot; NaN counts as 0: a foot that never swings has no height.
        mirror: Index of each foot's mirror image.
    """
    values = np.nan_to_num(values)
    mean, difference = (values + values[mirror]) / 2, np.abs(values - values[mirror])
    return float(np.divide(difference, mean, out=np.zeros_like(mean), where=mean > 0).max())


def draw_contacts(contacts: Mapping[str, str], dt: float) -> bytes:
    """Return a contact diagram as a PNG: one row per foot, black while it is in contact.

    Args:
        contacts: Contacts of each foot, by name: one character per step, 1 in contact.
        dt: Time between steps [s].
    """
    import cv2

    rows = np.array([[each == "1" for each in text] for text in contacts.values()])
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
