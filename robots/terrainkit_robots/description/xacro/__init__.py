"""Expand xacro files in a child process and read the result as URDF."""
