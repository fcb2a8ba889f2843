"""The picture of a robot among the published ones: how usual its masses, limits and gains are."""

import math
from collections.abc import Mapping
from itertools import product

import numpy as np

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.norms import QUANTITIES, ROLES, Norm, measure, norms
from terrainkit_robots.text import group

_SHOWN = ("mass", "mass share", "density", "effort", "velocity", "range", "stiffness", "damping")
"""The quantities of the picture, in order."""

_ROW, _MARGIN = 22, 14
_ROLE, _START, _LEFT, _RIGHT, _END, _WIDTH = 350, 410, 530, 750, 870, 1180
"""Sizes, and where the role and the scale of a row start, 90 % of the robots are, and it ends
[px]."""

_BLACK, _GRAY, _SCALE, _USUAL = (30, 30, 30), (120, 120, 120), (240, 240, 240), (205, 222, 200)
_GREEN, _ORANGE, _RED = (60, 140, 50), (0, 130, 245), (40, 40, 210)
"""Colors, as BGR."""


def draw_norms(robot: Facts, gains: Mapping[str, tuple[float, float]] | None = None) -> bytes:
    """Return a PNG with a row for each role of a link or joint and each quantity.

    The band in the middle of a row is where 90 % of the published robots are, on a logarithmic
    scale. The bar is where the links or joints of this robot are: green inside of the band, orange
    outside, and red where the value is unusual.

    Args:
        robot: The robot.
        gains: Stiffness and damping by joint. By default, those of the file.
    """
    import cv2

    rows = group(((s.quantity, s.role), s.value) for s in measure(robot, gains))
    keys = [key for key in product(_SHOWN, ROLES) if key in rows and key in norms()]
    image = np.full(((len(keys) + 2) * _ROW + 2 * _MARGIN, _WIDTH, 3), 255, np.uint8)

    def write(text: str, x: int, y: int, color: tuple[int, int, int] = _BLACK) -> None:
        font = cv2.FONT_HERSHEY_SIMPLEX
        cv2.putText(image, text, (x, y + 16), font, 0.42, color, 1, cv2.LINE_AA)

    write(f"{robot.model.title} among published robots", _MARGIN, _MARGIN)
    write("90 % of the robots" if keys else "nothing to compare", _LEFT + 50, _MARGIN, _GRAY)
    before = ""
    for number, (quantity, role) in enumerate(keys, 2):
        norm, values = norms()[quantity, role], rows[quantity, role]
        y = _MARGIN + number * _ROW
        if quantity != before:
            what, unit = QUANTITIES[quantity]
            write(f"{what} [{unit or 1}]", _MARGIN, y)
        before = quantity
        write(role, _ROLE, y)
        image[y + 3 : y + _ROW - 3, _START:_END] = _SCALE
        image[y + 3 : y + _ROW - 3, _LEFT:_RIGHT] = _USUAL
        ends = [_place(value, norm) for value in (min(values), max(values))]
        worst = max(values, key=lambda value: abs(_place(value, norm) - (_LEFT + _RIGHT) / 2))
        color, text = _verdict(worst, norm)
        cv2.rectangle(image, (ends[0] - 3, y + 7), (ends[1] + 3, y + _ROW - 8), color, -1)
        write(f"{worst:.3g}  (median {norm.median:.3g}){text}", _END + _MARGIN, y, color)
    return bytes(cv2.imencode(".png", image)[1])


def _place(value: float, norm: Norm) -> int:
    """Return the place of a value in its row [px]."""
    low, high = norm.usual
    share = math.log(value / low) / math.log(high / low)
    return round(min(max(_LEFT + share * (_RIGHT - _LEFT), _START + 4), _END - 4))


def _verdict(value: float, norm: Norm) -> tuple[tuple[int, int, int], str]:
    """Return the color of a value, and what to say about it."""
    (usual_low, usual_high), (low, high) = norm.usual, norm.limits
    if usual_low <= value <= usual_high:
        return _GREEN, ""
    below = norm.robots_below(value)
    text = f"above {below}" if value > norm.median else f"below {norm.robots - below}"
    return (_ORANGE if low <= value <= high else _RED), f", {text} of {norm.robots}"
