"""Replace collision meshes by convex or primitive shapes."""
