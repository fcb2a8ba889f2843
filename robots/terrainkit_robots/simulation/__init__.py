"""Simulate a robot in MuJoCo: drop it, let it stand, and sweep its joints."""
