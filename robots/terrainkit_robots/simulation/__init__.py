"""Simulation: the robot in MuJoCo, dropped, standing, swept through its joints."""
