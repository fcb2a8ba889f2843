"""The surface as triangles, including walls.

There are three meshes of the same surface: `full_mesh` has two triangles per cell,
`merged_mesh` merges coplanar faces, and `closed_mesh` makes a watertight solid of
either. Faces are counterclockwise seen from above, and every interior edge is shared by exactly two
faces, also between large merged faces and small ones.
"""

from terrainkit.geometry.mesh.closed import closed_mesh
from terrainkit.geometry.mesh.full import full_mesh
from terrainkit.geometry.mesh.merged import merged_mesh
from terrainkit.geometry.mesh.tri_mesh import TriMesh

__all__ = ["TriMesh", "closed_mesh", "full_mesh", "merged_mesh"]
