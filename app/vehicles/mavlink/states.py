"""Successors of the frozen states of a trial, which change with every packet, some hundred times a second."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dataclasses import replace
else:

    def replace(state, /, **changes):
        """As `dataclasses.replace`, without the constructor, in a sixth of its time: for classes without slots and
        without `__post_init__`. Raises TypeError for a field that the class lacks."""
        if not changes.keys() <= state.__dict__.keys():
            raise TypeError(f"{type(state).__name__} has no {', '.join(changes.keys() - state.__dict__.keys())}")
        successor = object.__new__(type(state))
        successor.__dict__.update(state.__dict__, **changes)
        return successor


__all__ = ["replace"]
