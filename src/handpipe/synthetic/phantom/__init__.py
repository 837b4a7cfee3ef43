"""Phantoms: a finger and a hand of simple shapes in known poses."""

__all__: list[str] = []
