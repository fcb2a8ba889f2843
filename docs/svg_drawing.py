"""A picture of lines, shapes and texts as SVG, for the documentation."""

from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path

Point = Sequence[float]

INK = "#28282e"
GRAY = "#8a8a92"
PALE = "#e3ded2"
BLUE = "#1f5fa8"
RED = "#c0392b"
GREEN = "#2e7d4f"
ORANGE = "#d08a2e"
"""Colors of the pictures."""


class Drawing:
    """A picture whose parts are in the pixels of the page, or in meters after `set_scale`."""

    def __init__(self, width: int, height: int) -> None:
        self.size = (width, height)
        self._parts: list[str] = []
        self.set_scale()

    def set_scale(self, scale: Point = (1, 1), origin: Point = (0, 0)) -> None:
        """Set the pixels per unit along x and y, and the pixel of the origin."""
        self._scale = scale
        self._origin = origin

    def _pixel(self, point: Point) -> tuple[float, float]:
        x, y = (o + s * p for o, s, p in zip(self._origin, self._scale, point, strict=True))
        return round(float(x), 2), round(float(y), 2)

    def line(
        self, points: Iterable[Point], color: str = INK, width: float = 1.5, dash: str = ""
    ) -> None:
        """Draw a line through points; `dash` has the lengths of dashes and gaps [pixels]."""
        corners = " ".join("{},{}".format(*self._pixel(point)) for point in points)
        style = f'stroke="{color}" stroke-width="{width}" stroke-linejoin="round"'
        style += f' stroke-dasharray="{dash}"' if dash else ""
        self._parts.append(f'<polyline points="{corners}" fill="none" {style}/>')

    def polygon(self, points: Iterable[Point], fill: str, edge: str = "none") -> None:
        """Fill a polygon."""
        corners = " ".join("{},{}".format(*self._pixel(point)) for point in points)
        self._parts.append(f'<polygon points="{corners}" fill="{fill}" stroke="{edge}"/>')

    def box(self, low: Point, high: Point, fill: str, edge: str = "none") -> None:
        """Fill a rectangle between two corners."""
        self.polygon([low, (high[0], low[1]), high, (low[0], high[1])], fill, edge)

    def dot(self, point: Point, radius: float, fill: str, edge: str = "none") -> None:
        """Draw a disk with a radius in pixels."""
        x, y = self._pixel(point)
        circle = f'<circle cx="{x}" cy="{y}" r="{radius}" fill="{fill}" stroke="{edge}"/>'
        self._parts.append(circle)

    def arrow(self, start: Point, end: Point, color: str = INK, width: float = 1.5) -> None:
        """Draw a line with a head at its end."""
        (x, y), (tip_x, tip_y) = self._pixel(start), self._pixel(end)
        length = max(1e-9, ((tip_x - x) ** 2 + (tip_y - y) ** 2) ** 0.5)
        along_x, along_y = 7 * (tip_x - x) / length, 7 * (tip_y - y) / length
        sides = [
            (tip_x - along_x - side * along_y / 2, tip_y - along_y + side * along_x / 2)
            for side in (1, -1)
        ]
        self.line([start, end], color, width)
        corners = " ".join(f"{a:.2f},{b:.2f}" for a, b in [(tip_x, tip_y), *sides])
        self._parts.append(f'<polygon points="{corners}" fill="{color}"/>')

    def text(
        self, point: Point, text: str, color: str = INK, size: int = 13, anchor: str = "start"
    ) -> None:
        """Write a text beside a point: its start, its middle or its end."""
        x, y = self._pixel(point)
        style = f'fill="{color}" font-size="{size}" text-anchor="{anchor}"'
        self._parts.append(f'<text x="{x}" y="{y}" {style}>{escape(text)}</text>')

    def write(self, path: Path) -> None:
        """Write the picture on a light background, which pages in dark mode need."""
        width, height = self.size
        root = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}"'
        root += f' width="{width}" height="{height}" font-family="sans-serif">'
        back = f'<rect width="{width}" height="{height}" fill="#faf9f6"/>'
        path.write_text("\n".join([root, back, *self._parts, "</svg>", ""]))
