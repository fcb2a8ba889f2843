"""Where a robot uses its mesh files, and whether their scale fits."""
