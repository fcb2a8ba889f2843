"""Read URDF files."""
