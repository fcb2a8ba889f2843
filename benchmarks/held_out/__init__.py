"""Defects written without knowledge of the rules of check-robot, to measure its recall."""
