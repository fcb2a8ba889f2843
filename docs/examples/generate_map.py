"""Generate a map, look at it, and write it for a simulator.

Install: pip install . (in a clone of terrainkit)
"""

import terrainkit
from terrainkit.views.preview import write_preview

# Rows are levels of difficulty, columns are terrain types. The same seed gives the same map.
config = terrainkit.MapConfig(rows=10, cols=10, patch_size=(8.0, 8.0), seed=3)
terrain_map = terrainkit.generate(config)
print(terrain_map)

row, col = 6, 5
patch = terrain_map.patch(row, col)
x, y, z = terrain_map.env_origins[row, col]
print(f"patch ({row}, {col}): {patch.terrain}, difficulty {patch.difficulty:.2f}")
print(f"  step height {patch.parameters.realized['step_height']:.3f} m")
print(f"  robots start at x {x:.2f} m, y {y:.2f} m, z {z:.2f} m")

write_preview(terrain_map, "map.png", overwrite=True)
terrain_map.save("map.npz", overwrite=True)  # numpy arrays, which all integrations read
terrain_map.save("map.xml", overwrite=True)  # MuJoCo; also .usd, .sdf, .stl, .ply, .obj, .glb
print("wrote map.png, map.npz and map.xml; see also: terrainkit view map.npz")
