"""Tendons: rods in neutral and in poses, hooks."""
