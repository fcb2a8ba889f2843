"""Rigid bodies: kinematics, contact points, overlaps."""
