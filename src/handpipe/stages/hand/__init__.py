"""The whole hand: simulated poses and scenes, their figures, exports, the report."""
