"""TriMesh: vertices and the triangles between them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True, eq=False)
class TriMesh:
    """A triangle mesh."""

    vertices: NDArray[np.float32]
    """Positions [m], shape (nv, 3)."""

    triangles: NDArray[np.int32]
    """Three vertices for each face, anticlockwise seen from outside, shape (nf, 3)."""
