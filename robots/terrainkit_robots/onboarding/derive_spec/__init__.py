"""Derive a RobotSpec from the facts of a robot."""
