"""The spec: what training needs to know of a robot beyond its description."""
