"""Onboard a robot: convert its file into a folder with everything that training needs."""
