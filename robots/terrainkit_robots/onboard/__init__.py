"""Onboarding: from a robot's file to a folder that simulators and training take."""
