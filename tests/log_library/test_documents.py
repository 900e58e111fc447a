"""The documented schema of an answer."""

import json

from jsonschema import Draft202012Validator

from app.core.reasons import ReasonCode
from app.log_library.shapes import WORDS
from tests.log_library.documents import DOCUMENTED, generated


def test_the_documented_schema_is_that_of_the_program() -> None:
    """Write it again with `python -m tests.log_library.test_documents`."""
    assert json.loads(DOCUMENTED.read_text()) == generated()
    Draft202012Validator.check_schema(generated())


def test_every_reason_is_documented() -> None:
    text = (DOCUMENTED.parent / "from-log-to-gains.md").read_text()
    assert [code.key for code in ReasonCode if f"`{code.key}`" not in text] == []


def test_every_shape_of_failure_is_documented_as_it_is_told() -> None:
    text = (DOCUMENTED.parent / "failure-shapes.md").read_text()
    for shape, words in WORDS.items():
        assert f"## {words.title}\n\n![{words.title}](images/failure-shape-{shape.replace('_', '-')}.svg)" in text
        assert f"(`{shape}`). {words.recognised}\n" in text
        assert words.advice in text


if __name__ == "__main__":
    DOCUMENTED.write_text(json.dumps(generated(), indent=2) + "\n")
