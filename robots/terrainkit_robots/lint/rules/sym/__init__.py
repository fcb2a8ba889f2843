"""Rules on the symmetry of left and right (SYM)."""
