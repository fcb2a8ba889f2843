"""Import a scan: the mesh of a hall with steps and a table becomes a map.

Install: pip install . (in a clone of terrainkit)
"""

import numpy as np
import trimesh

from terrainkit import ImportOptions, import_map
from terrainkit.views.preview import write_preview

# In place of your scan: uneven ground of 12 m x 8 m, two steps, and a table.
rng = np.random.default_rng(0)
ground = trimesh.creation.box([12.0, 8.0, 0.5]).subdivide_to_size(0.25)
ground.vertices[:, 2] += rng.uniform(-0.02, 0.02, len(ground.vertices))
parts = [ground]
for size, center in (
    ((2.0, 3.0, 0.4), (3.5, 0.0, 0.2)),
    ((1.0, 3.0, 0.4), (4.0, 0.0, 0.4)),
    ((2.0, 1.2, 0.1), (-3.0, 1.0, 1.0)),  # the top of the table
    ((0.1, 1.2, 0.9), (-3.9, 1.0, 0.5)),
    ((0.1, 1.2, 0.9), (-2.1, 1.0, 0.5)),
):
    parts.append(trimesh.creation.box(size).apply_translation(center))
trimesh.util.concatenate(parts).export("scan.ply")

# `solids` keeps what hangs over the ground, here the table.
options = ImportOptions(solids=True, spawn_tolerance=0.06)
imported = import_map("scan.ply", options)
terrain_map, report = imported.terrain_map, imported.report
print(f"{terrain_map}, {len(terrain_map.solids)} solids")
print(f"area under overhangs: {report.overhang_area:.2f} m2, lost: {report.lost_area:.2f} m2")
# The lower corner of the scan is (0, 0), and the table is at x = 3 m, y = 5 m.
print(f"free height under the table: {terrain_map.clearance([3.0, 5.0]):.2f} m")
x, y, z = terrain_map.env_origins[0, 0]
print(f"robots start at x {x:.2f} m, y {y:.2f} m, z {z:.2f} m")
terrain_map.save("scan.npz", overwrite=True)
print("wrote scan.npz and", write_preview(terrain_map, "scan.png", overwrite=True))
