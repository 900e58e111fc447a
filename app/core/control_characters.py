"""Invisible characters that change how text is displayed.

In a name they can rewrite a terminal's lines, or reverse text so that one name looks like another.
"""

import unicodedata
from typing import Final

_BIDIRECTIONAL: Final = frozenset("\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")
"""Marks, embeddings, overrides and isolates (Unicode Standard Annex 9)."""
_LINE_ENDS: Final = frozenset("\u2028\u2029")


def is_control(character: str) -> bool:
    """Whether the character is in C0 or C1 (escape included), DEL, a bidirectional control or a line separator."""
    return unicodedata.category(character) == "Cc" or character in _BIDIRECTIONAL or character in _LINE_ENDS


def find_control_characters(text: str) -> tuple[str, ...]:
    """Control characters in a text, as `U+001B`, each once and in code point order."""
    return tuple(f"U+{ord(each):04X}" for each in sorted(set(filter(is_control, text))))


def without_control_characters(text: str) -> str:
    return "".join(each for each in text if not is_control(each))
