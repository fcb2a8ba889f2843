"""Simulators: what each makes of a robot's joints and links."""
