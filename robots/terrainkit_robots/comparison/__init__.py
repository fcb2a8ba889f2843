"""Comparison: two descriptions of one robot, side by side."""
