"""Detect legs and solve the standing pose."""
