"""Legs: which limbs they are, how the robot stands on them, and what that takes."""
