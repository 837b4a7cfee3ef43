"""Joints whose bones roll: contact of articular surfaces, ligaments as springs, and a hand of such joints."""

__all__: list[str] = []
