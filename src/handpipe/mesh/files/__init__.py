"""Polygons of surface files: OBJ, PLY and STL."""

__all__: list[str] = []
