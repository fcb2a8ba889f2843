"""Robots: from a robot's file to what is wrong with it, and to a robot that trains.

Empty until the robot linter, `terrainkit check-robot`, moves in.
"""
