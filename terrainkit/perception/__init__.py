"""What robots perceive of a map: height scans, rays, voxels, edges, and the errors of real maps.

For any training loop. Arguments are numpy arrays, or tensors of torch on any device; results are of
the same kind. Computation is in numpy, so torch is not imported otherwise.
"""

from terrainkit.perception.edge_map import EdgeMap
from terrainkit.perception.height_scan import HeightScan, exact_surface
from terrainkit.perception.map_errors import MapErrorOptions, MapErrors
from terrainkit.perception.orientation import projected_gravity, quat_to_yaw
from terrainkit.perception.ray_caster import RayCaster, depth_directions, lidar_directions
from terrainkit.perception.voxel_grid import VoxelGrid

__all__ = [
    "EdgeMap",
    "HeightScan",
    "MapErrorOptions",
    "MapErrors",
    "RayCaster",
    "VoxelGrid",
    "depth_directions",
    "exact_surface",
    "lidar_directions",
    "projected_gravity",
    "quat_to_yaw",
]
