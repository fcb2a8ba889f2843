"""Write robots as URDF, MJCF and mesh files."""
