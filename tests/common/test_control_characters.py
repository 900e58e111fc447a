import pytest

from app.common.schemas import find_control_characters, is_control, without_control_characters


@pytest.mark.parametrize("character", ["\x00", "\x1b", "\x7f", "\x9b", "\n", "\u202e", "\u2066", "\u200f", "\u2028"])
def test_what_is_not_seen_and_changes_what_is_seen_is_a_control_character(character: str) -> None:
    assert is_control(character)


@pytest.mark.parametrize("character", ["a", "é", "Ω", " ", "…", "\u00a0", "日"])
def test_what_is_seen_is_none(character: str) -> None:
    assert not is_control(character)


def test_they_are_named_once_each_in_order_and_left_out() -> None:
    text = "Ada\u202e's \x1b[31mdrone\x1b"
    assert find_control_characters(text) == ("U+001B", "U+202E")
    assert without_control_characters(text) == "Ada's [31mdrone"
    assert find_control_characters("Ada's drone") == ()
