"""Robots: from a robot's file to what is wrong with it, and to a robot that trains."""
