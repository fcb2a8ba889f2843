"""The trimesh: the surface as triangles, walls included.

Three meshes of one surface: :func:`full_mesh` has two triangles for every cell,
:func:`merged_mesh` joins what is level, :func:`closed_mesh` makes either a watertight solid. All
are oriented, anticlockwise seen from above, and every edge inside them is shared by exactly two
triangles, also where merging has left large faces beside small ones.
"""

from terrainkit.mesh.closed import closed_mesh
from terrainkit.mesh.full import full_mesh
from terrainkit.mesh.merged import merged_mesh
from terrainkit.mesh.tri_mesh import TriMesh

__all__ = ["TriMesh", "closed_mesh", "full_mesh", "merged_mesh"]
