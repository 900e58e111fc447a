"""The secret of a data folder, and links that work once."""

import os
import stat
from pathlib import Path

import pytest

from app.accounts.keys_and_links import LINK_VALID_S, Keyring
from app.accounts.permissions import Key
from app.common.errors import StorageError


class Clock:
    """A test's own."""

    def __init__(self) -> None:
        self.now = 1.8e9

    def __call__(self) -> float:
        return self.now


def test_its_files_are_accessible_to_their_owner_only(tmp_path: Path) -> None:
    keyring = Keyring(tmp_path)
    keyring.new_link()
    access = tmp_path / "access"
    kept = [access, *access.rglob("*")]
    assert len(kept) == 4
    assert [path.name for path in kept if stat.S_IMODE(path.stat().st_mode) & 0o077] == []


def test_a_restart_keeps_the_keys_and_another_folder_has_others(tmp_path: Path) -> None:
    first, again = Keyring(tmp_path), Keyring(tmp_path)
    (tmp_path / "other").mkdir()
    other = Keyring(tmp_path / "other")
    assert first.value(Key.BROWSER) == again.value(Key.BROWSER) != other.value(Key.BROWSER)
    assert first.cookie == again.cookie != other.cookie


@pytest.mark.parametrize("key", [Key.REMOTE, Key.SCRIPT, Key.BROWSER])
def test_a_value_shows_its_key_and_nothing_near_it_does(tmp_path: Path, key: Key) -> None:
    keyring = Keyring(tmp_path)
    value = keyring.value(key)
    assert keyring.key_of(value) == key
    for wrong in ("", value[:-1], value + "0", value.upper(), "ü" + value[1:], key.name):
        assert keyring.key_of(wrong) == Key.NONE


def test_a_link_works_once_whoever_opens_it(tmp_path: Path) -> None:
    token = Keyring(tmp_path).new_link()
    assert not Keyring(tmp_path).open_link(token + "x")
    assert Keyring(tmp_path).open_link(token)
    assert not Keyring(tmp_path).open_link(token)


def test_a_link_is_good_for_a_quarter_of_an_hour(tmp_path: Path) -> None:
    clock = Clock()
    keyring = Keyring(tmp_path, now_s=clock)
    late, in_time = keyring.new_link(), keyring.new_link()
    clock.now += LINK_VALID_S - 1
    assert keyring.open_link(in_time)
    clock.now += 2
    assert not keyring.open_link(late)


def test_the_files_of_old_links_go(tmp_path: Path) -> None:
    clock = Clock()
    keyring = Keyring(tmp_path, now_s=clock)
    keyring.new_link()
    clock.now += LINK_VALID_S + 1
    keyring.new_link()
    assert len(list((tmp_path / "access" / "links").iterdir())) == 1


def test_no_token_is_stored_and_none_leads_out_of_the_folder(tmp_path: Path) -> None:
    keyring = Keyring(tmp_path)
    token = keyring.new_link()
    assert token not in "".join(path.name + path.read_text() for path in (tmp_path / "access" / "links").iterdir())
    (tmp_path / "kept").touch()
    assert not keyring.open_link("../../kept")
    assert (tmp_path / "kept").exists()


def test_a_damaged_secret_is_reported_with_what_to_do(tmp_path: Path) -> None:
    Keyring(tmp_path)
    os.truncate(tmp_path / "access" / "secret", 3)
    with pytest.raises(StorageError, match="does not contain 32 bytes"):
        Keyring(tmp_path)
