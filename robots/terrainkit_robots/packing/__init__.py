"""Packing: a robot's mesh files, copied into one that goes wherever its folder does."""
