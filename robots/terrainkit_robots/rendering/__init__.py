"""Render robot pictures and policy videos off-screen with MuJoCo."""
