"""Time of the comparison of an imported map with its file, relative to the rest of the import."""

import tempfile
from collections.abc import Iterator
from pathlib import Path
from unittest import mock

import numpy as np
import trimesh
from clock import ratio

from terrainkit import ImportOptions, import_map
from terrainkit.map.import_report import ImportReport


def run() -> Iterator[tuple[str, float]]:
    rng = np.random.default_rng(0)
    x, y = np.meshgrid(np.arange(701) * 0.1, np.arange(701) * 0.1, indexing="ij")
    heights = np.sin(x) * np.cos(y) + rng.normal(0, 0.005, x.shape)
    first = (np.arange(700)[:, None] * 701 + np.arange(700)).ravel()
    faces = [[first, first + 701, first + 702], [first, first + 702, first + 1]]
    vertices = np.column_stack([x.ravel(), y.ravel(), heights.ravel()])
    mesh = trimesh.Trimesh(vertices, np.hstack(faces).T, process=False)
    with tempfile.TemporaryDirectory() as folder:
        mesh.export(Path(folder, "a.stl"))
        np.save(Path(folder, "a.npy"), np.tile(heights, (3, 3)))
        options = ImportOptions(file_cell=0.1, scale=1.0)

        def whole(name: str) -> None:
            import_map(Path(folder, name), options)

        def without_report(name: str) -> None:
            module = "terrainkit.importing.maps.import_map.make_report"
            with mock.patch(module, return_value=ImportReport()):
                whole(name)

        for name, text in (("a.stl", "mesh (at most 2.5)"), ("a.npy", "raster (at most 1.4)")):
            with_report, alone = (lambda f=f, n=name: f(n) for f in (whole, without_report))
            yield f"report_of_{text}", ratio(with_report, alone, num_runs=5)
