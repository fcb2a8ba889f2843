"""A stand-in for Isaac Gym without physics, for the classes of legged_gym under Python 3.8.

It reads the URDF, merges fixed joints, and orders siblings by name, as Isaac Gym does.
"""
