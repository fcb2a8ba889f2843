"""Geometry: the grid, the surface of heights with vertical walls, solids, boxes and meshes."""
