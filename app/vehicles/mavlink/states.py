"""Successors of the frozen states of a trial, which change with every packet, some hundred times a second."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dataclasses import replace
else:

    def replace(state, /, **changes):
        """As `dataclasses.replace`, without the constructor, in a tenth of its time: for classes without slots and
        without `__post_init__`. Raises TypeError for a field that the class lacks."""
        fields = state.__dict__
        if not changes.keys() <= fields.keys():
            raise TypeError(f"{type(state).__name__} has no {', '.join(changes.keys() - fields.keys())}")
        successor = object.__new__(type(state))
        object.__setattr__(successor, "__dict__", fields | changes)
        return successor


__all__ = ["replace"]
