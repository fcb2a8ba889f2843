"""Copy and convert the mesh files of a robot."""
