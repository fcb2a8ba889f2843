"""MJCF: read by MuJoCo's own parser, with files and lines from ours."""
