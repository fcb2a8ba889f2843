"""Compare two descriptions of one robot."""
