"""Characters that are not seen and change how others are: in a name they can rewrite a terminal's lines, or turn text
around so that one name looks like another."""

import unicodedata
from typing import Final

_BIDIRECTIONAL: Final = frozenset("\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")
"""Marks, embeddings, overrides and isolates (Unicode Standard Annex 9)."""
_LINE_ENDS: Final = frozenset("\u2028\u2029")


def is_control(character: str) -> bool:
    """Whether it is one of C0, C1 (the escape character among them), DEL, a bidirectional control or a line's end."""
    return unicodedata.category(character) == "Cc" or character in _BIDIRECTIONAL or character in _LINE_ENDS


def find_control_characters(text: str) -> tuple[str, ...]:
    """Those that a text holds, as `U+001B`, each once and in the order of their numbers."""
    return tuple(f"U+{ord(each):04X}" for each in sorted(set(filter(is_control, text))))


def without_control_characters(text: str) -> str:
    return "".join(each for each in text if not is_control(each))
