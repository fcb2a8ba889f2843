"""ImportReport: what a map lost of the file that it was imported from."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class ImportReport:
    """What the map does not have in common with the file."""

    num_missing: int = 0
    """Number of missing heights, which were filled."""

    num_walls: int = 0
    """Number of neighboring samples with a wall between them, counted if there are steep slopes."""

    num_steep_slopes: int = 0
    """Number of neighboring samples that differ by more than `slope_threshold` without a wall."""

    num_points: int = 0
    """Number of points, not the samples of the map, where the file has ground and its highest
    surface was compared with that of the map."""

    shares: tuple[float, ...] = ()
    """Shares of these points with a difference of at most 1 cm, 5 cm and a cell."""

    max_error: float = 0.0
    """Largest difference between the highest surfaces of the file and the map [m], also at the
    corners of the faces of a mesh and the samples of a raster. A wall is allowed to be in another
    place between the same two samples."""

    max_error_at: tuple[float, float] | None = None
    """Where that is in the map, x and y [m]."""

    further_errors: tuple[tuple[float, float, float], ...] = ()
    """The next differences above 1 cm that are at least ten cells away, with their x and y [m]."""

    covered_area: float = 0.0
    """Area of the map where the file has ground [m2]."""

    filled_area: float = 0.0
    """Area within the file where the map has ground and the file has none [m2]."""

    lost_ground_area: float = 0.0
    """Area where the file has ground and the map a hole [m2], more than a cell from its edge."""

    hole_area: float = 0.0
    """Area of the holes where a mesh has no ground [m2]."""

    num_lost_faces: int = 0
    """Number of faces of a mesh that reach more than half a cell above the map: parts narrower than
    a cell, or overhangs without a solid."""

    overhang_area: float = 0.0
    """Area over which a part of the mesh hangs over the ground [m2]."""

    lost_area: float = 0.0
    """Part of that area where the map has no overhang [m2]: its ground is the top of the mesh, or
    the sky is open."""

    overhang_error: float = 0.0
    """Largest difference in height between the map and the mesh where something hangs over the
    ground [m]: of the ground, or of the lower or upper side of a solid."""

    overhang_error_at: tuple[float, float] | None = None
    """Where that is in the map, x and y [m]; None without overhangs."""

    hidden_area: float = 0.0
    """Area where surfaces without thickness, such as floors, are more than half a cell above each
    other, and the map has only the highest one [m2]."""

    num_thin_bodies: int = 0
    """Number of closed bodies narrower than a cell, which became solids."""

    num_open_bodies: int = 0
    """Number of connected parts of the mesh that are not closed, and therefore without solids;
    counted only if solids were requested."""
