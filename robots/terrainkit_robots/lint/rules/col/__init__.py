"""Rules on collision shapes (COL)."""
