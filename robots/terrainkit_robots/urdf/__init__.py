"""URDF: its words, and its reader."""
