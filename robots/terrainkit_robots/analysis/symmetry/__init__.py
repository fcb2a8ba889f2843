"""Left-right symmetry of a robot."""
