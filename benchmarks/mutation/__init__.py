"""Plant changes in a copy of the working tree and run tests on it."""
