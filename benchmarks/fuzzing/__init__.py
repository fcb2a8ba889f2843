"""Damaged and hostile files, and the commands that read them in forked processes."""
