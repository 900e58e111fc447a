"""What every answer to a log is, as JSON: valid by the documented schema, and data outside of its texts."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from jsonschema import Draft202012Validator

from app.log_library.library_schemas import LogExport
from app.log_library.schemas import LogAnswer

_DOCS: Final = Path(__file__).parents[2] / "docs"
DOCUMENTED: Final = _DOCS / "log-answer.schema.json"
EXPORTED: Final = _DOCS / "log-export.schema.json"
_MAY_HAVE_BLANKS: Final = frozenset({"file_name", "name", "suggested_name", "title", "vehicle_name"})


def generated() -> dict[Path, dict[str, Any]]:
    """The schemas of what the program writes, by their documents."""
    written: dict[Path, type[LogAnswer]] = {DOCUMENTED: LogAnswer, EXPORTED: LogExport}
    return {document: model.model_json_schema(mode="serialization") for document, model in written.items()}


def require_data(answer: Mapping[str, Any]) -> None:
    """Fail unless an answer is valid, and has no formatted string outside of its texts."""
    Draft202012Validator(json.loads(DOCUMENTED.read_text())).validate(dict(answer))
    found = {place: text for place, text in _strings(answer) if " " in text or "\u00a0" in text}
    assert found == {}, found


def _strings(value: object, place: str = "") -> Iterator[tuple[str, str]]:
    if isinstance(value, str):
        yield place, value
    elif isinstance(value, Mapping):
        for name, each in value.items():
            if name != "texts" and name not in _MAY_HAVE_BLANKS:
                yield from _strings(each, f"{place}.{name}")
    elif isinstance(value, list):
        for number, each in enumerate(value):
            yield from _strings(each, f"{place}[{number}]")
