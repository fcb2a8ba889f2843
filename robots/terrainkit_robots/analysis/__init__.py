"""Compute facts about a robot from its description."""
