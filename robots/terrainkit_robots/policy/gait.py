"""Gait metrics: functions of the contacts, heights and speeds of feet over time.

Arrays have the shape (t, n, f): t steps of n robots with f feet. Contacts are Boolean, and
`measured`, shape (t, n), selects the steps that count.
"""

import numpy as np
from numpy.typing import NDArray

from terrainkit_robots.transforms import BoolArray, FloatArray

MIN_SWING_STEPS = 2
"""Shorter interruptions of a contact are vibrations, not swings [steps]."""


def find_swings(contact: BoolArray, measured: BoolArray) -> tuple[NDArray[np.int64], ...]:
    """Return all complete swings.

    A swing is complete if its steps, the step before and the step after are measured.

    Args:
        contact: Contacts, shape (t, n, f).
        measured: Which steps count, shape (t, n).

    Returns:
        Column (f * robot + foot), takeoff step and touchdown step of each swing, each of shape
        (k,).
    """
    steps, _, feet = contact.shape
    known = np.repeat(measured, feet, axis=1).T
    air = known & ~contact.reshape(steps, -1).T
    # Padding with steps that do not count ends every run of steps in the air.
    edges = np.diff(np.pad(air.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    (column, start), stop = np.nonzero(edges == 1), np.nonzero(edges == -1)[1]
    inside = (start > 0) & (stop < steps) & (stop - start >= MIN_SWING_STEPS)
    column, start, stop = column[inside], start[inside], stop[inside]
    complete = known[column, start - 1] & known[column, stop]
    return column[complete], start[complete], stop[complete]


def swing_heights(contact: BoolArray, height: FloatArray, measured: BoolArray) -> FloatArray:
    """Return the mean peak height of the swings of each foot.

    Args:
        contact: Contacts, shape (t, n, f).
        height: Heights of the feet [m], shape (t, n, f).
        measured: Which steps count, shape (t, n).

    Returns:
        Heights [m], shape (f,); NaN for a foot without a complete swing.
    """
    steps, _, feet = contact.shape
    column, start, stop = find_swings(contact, measured)
    bounds = steps * column[:, None] + np.column_stack([start, stop])
    heights = height.reshape(steps, -1).T.ravel()
    peaks = np.maximum.reduceat(heights, bounds.ravel())[::2] if len(column) else np.zeros(0)
    total, count = np.bincount(column % feet, peaks, feet), np.bincount(column % feet, None, feet)
    return np.divide(total, count, out=np.full(feet, np.nan), where=count > 0)


def step_frequency(contact: BoolArray, measured: BoolArray, dt: float) -> float:
    """Return the number of complete swings per foot and second.

    Args:
        contact: Contacts, shape (t, n, f).
        measured: Which steps count, shape (t, n).
        dt: Time between two steps [s].

    Returns:
        Frequency [Hz]; NaN if no step counts.
    """
    seconds = dt * measured.sum() * contact.shape[2]
    return len(find_swings(contact, measured)[0]) / seconds if seconds else np.nan


def duty_factors(contact: BoolArray, measured: BoolArray) -> FloatArray:
    """Return the share of the measured time that each foot is in contact.

    Args:
        contact: Contacts, shape (t, n, f).
        measured: Which steps count, shape (t, n).

    Returns:
        Shares, 0 to 1, shape (f,); NaN if no step counts.
    """
    share: FloatArray = contact[measured].mean(axis=0) if measured.any() else np.nan * contact[0, 0]
    return share


def foot_slip(contact: BoolArray, speed: FloatArray, measured: BoolArray) -> float:
    """Return the mean horizontal speed of feet in contact.

    Args:
        contact: Contacts, shape (t, n, f).
        speed: Horizontal speeds of the feet [m/s], shape (t, n, f).
        measured: Which steps count, shape (t, n).

    Returns:
        Speed [m/s]; NaN without contact.
    """
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
