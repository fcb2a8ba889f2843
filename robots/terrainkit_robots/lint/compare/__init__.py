"""Compare two descriptions of a robot."""
