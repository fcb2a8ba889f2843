"""Configurations: the robot as the class that a training framework wants."""
