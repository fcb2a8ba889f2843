"""Rules on legs and the standing pose (LEG)."""
