"""Inputs that try to leave the sandboxes of terrainkit."""
