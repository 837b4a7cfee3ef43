"""Geometry of generated anatomy: implicit solids, tubes, chains of joints, warps."""

__all__: list[str] = []
