"""Finite elements of the truth, other than those that are fitted: quadratic tets, active fibre stress."""

__all__: list[str] = []
