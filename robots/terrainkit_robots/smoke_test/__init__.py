"""Smoke-test a robot: check whether it can be trained, with a short training."""
