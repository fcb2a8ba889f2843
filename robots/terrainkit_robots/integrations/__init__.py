"""Use robots and their tasks in other frameworks."""
