"""Levels learned from simulated frames against the simulation: seconds, errors, bounds, alarms."""
