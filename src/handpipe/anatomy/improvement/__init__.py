"""Labelled tet meshes made fit for simulation by local operations."""

__all__: list[str] = []
