"""ArduPilot's on-board log as text (.log), as old releases printed it or a ground station converted it: made binary.

A line is the name of a message and its values, separated by commas; FMT lines describe types as FMT messages do. Scaled
integers have their unit in the text, and modes are names.
"""

import re
import struct
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from app.logs.base import Contents

SCALES: Final[Mapping[str, float]] = MappingProxyType({**dict.fromkeys("cCeE", 1e-2), "L": 1e-7})
"""Of integers, by the letter of their column."""
SYNC: Final = b"\xa3\x95"
"""Begins every binary message."""
_FMT: Final = b"FMT"
_DESCRIPTION: Final = re.compile(rb"^FMT, *\d+, *\d+, *\w{1,4}, *[A-Za-z]+, *\w+ *(,|$)", re.MULTILINE)
_LINE: Final = re.compile(rb"[^\r\n]+")
_TEXTS: Final[Mapping[str, str]] = MappingProxyType({"n": "4s", "N": "16s", "Z": "64s"})
_LAYOUTS: Final[Mapping[str, str]] = MappingProxyType(
    {**_TEXTS, **dict(zip("bBhHiIqQgfdcCeEL", "bBhHiIqQefdhHiIi", strict=True))}
)

_Kind = tuple[bytes, str, struct.Struct]
"""The number of a type, and the letters and the layout of its columns."""


def is_dataflash_text(head: bytes) -> bool:
    """Whether a file with this head is a DataFlash log as text: a line describes a type."""
    return bool(_DESCRIPTION.search(head))


def as_binary(data: Contents) -> tuple[bytes, int]:
    """The same log in binary, and how many bytes are in lines that are no whole messages."""
    content, skipped = bytearray(), 0
    kinds: dict[bytes, _Kind] = {}
    for line in _LINE.finditer(data, 0, data.rfind(b"\n") + 1):
        name, _, values = line[0].partition(b",")
        try:
            if name == _FMT:
                content += _described(values, kinds)
            elif kinds:
                content += _message(values, *kinds[name])
        except (KeyError, ValueError, OverflowError, struct.error):
            skipped += len(line[0])
    return bytes(content), skipped


def _described(values: bytes, kinds: dict[bytes, _Kind]) -> bytes:
    """The message that describes a type, whose modes and unknown columns are texts, and add the type to `kinds`."""
    number, _, name, letters, *columns = (each.strip() for each in values.split(b","))
    known = "".join(each if each in _LAYOUTS else "N" for each in letters.decode("ascii"))
    kinds[name] = bytes([int(number)]), known, struct.Struct("<" + "".join(_LAYOUTS[each] for each in known))
    described = int(number), 3 + kinds[name][-1].size, name, known.encode(), b",".join(columns)
    return struct.pack("<3sBB4s16s64s", SYNC + b"\x80", *described)


def _message(values: bytes, number: bytes, letters: str, layout: struct.Struct) -> bytes:
    """A message with these values, of which the last may contain commas if it is a text."""
    cells = values.split(b",", len(letters) - (letters[-1:] in _TEXTS))
    packed = layout.pack(*(_value(letter, cell.strip()) for letter, cell in zip(letters, cells, strict=True)))
    return SYNC + number + packed


def _value(letter: str, cell: bytes) -> float | bytes:
    if letter in _TEXTS:
        return cell
    return float(cell) if letter in "gfd" else round(float(cell) / SCALES.get(letter, 1.0))
