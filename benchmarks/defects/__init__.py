"""Kinds of defects, one function each: it breaks one thing in a healthy robot."""
