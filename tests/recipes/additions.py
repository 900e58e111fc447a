"""Adds parts to the program of a process, as CONTRIBUTING.md says: new modules, and lines in those that are there."""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from importlib.util import spec_from_file_location
from pathlib import Path
from types import CodeType, ModuleType
from typing import Final


@dataclass(frozen=True, slots=True)
class Change:
    """A line of a module, `old`, that is replaced."""

    module: str
    old: str
    new: str

    def applied(self, source: str) -> str:
        assert source.count(self.old) == 1, f"{self.module} does not have this line once: {self.old}"
        return source.replace(self.old, self.new)


def line(module: str, added: str, *, before: str) -> Change:
    """A line added before another one, of which this is the beginning."""
    return Change(module, f"\n{before}", f"\n{added}\n{before}")


class _Changed(SourceFileLoader):
    """Loads a module with its changes; not from the cache of compiled modules."""

    def __init__(self, name: str, path: str, changes: Sequence[Change]) -> None:
        super().__init__(name, path)
        self._changes: Final = changes

    def get_code(self, fullname: str) -> CodeType:
        source = Path(self.path).read_text()
        for change in self._changes:
            source = change.applied(source)
        return compile(source, self.path, "exec")


class _Additions(MetaPathFinder):
    def __init__(self, added: Mapping[str, Path], changes: Sequence[Change]) -> None:
        self._added, self._changes = added, changes

    def find_spec(self, name: str, path: Sequence[str] | None, _target: ModuleType | None = None) -> ModuleSpec | None:
        if name in self._added:
            place = self._added[name]
            if place.is_dir():
                package = ModuleSpec(name, None, is_package=True)
                package.submodule_search_locations = [str(place)]
                return package
            return spec_from_file_location(name, place)
        changes = [change for change in self._changes if change.module == name]
        if not changes:
            return None
        found = PathFinder.find_spec(name, path)
        assert found is not None
        assert found.origin is not None
        is_package = found.submodule_search_locations
        loader = _Changed(name, found.origin, changes)
        return spec_from_file_location(name, found.origin, loader=loader, submodule_search_locations=is_package)


def add(added: Mapping[str, Path], *changes: Change) -> None:
    """Add modules (a folder is a package) and change others, before any of these is imported."""
    loaded = [name for name in (*added, *(change.module for change in changes)) if name in sys.modules]
    assert loaded == [], "loaded before it was changed"
    sys.meta_path.insert(0, _Additions(added, changes))
