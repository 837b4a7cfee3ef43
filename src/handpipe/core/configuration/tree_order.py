"""The order of a tree's joints: from the root outwards."""

from __future__ import annotations

from collections.abc import Mapping


def joint_order(ends: Mapping[str, tuple[str, str]]) -> list[str]:
    """Names of joints from the root outwards, each after the joint that carries its parent.

    Parameters
    ----------
    ends : mapping of str to (str, str)
        Parent and child of each joint of a tree.

    Returns
    -------
    list of str
        All names.

    Raises
    ------
    ValueError
        If joints carry one another in a circle, which no root carries; it names them.
    """
    reached = {parent for parent, _ in ends.values()} - {child for _, child in ends.values()}
    left, order = dict(ends), list[str]()
    while left:
        found = [name for name, (parent, _) in left.items() if parent in reached]
        if not found:
            raise ValueError(f"{', '.join(left)} carry one another in a circle, and no root carries them")
        reached |= {left.pop(name)[1] for name in found}
        order += found
    return order
