"""Puts the built UI into the wheel as `app/ui`, so that installing the wheel needs no Node."""

import subprocess
import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class UserInterfaceHook(BuildHookInterface[Any]):
    """From a checkout the UI is built first, by `./dev`; a source distribution carries it built."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if version == "editable":
            return
        root = Path(self.root)
        if (root / "frontend" / "package.json").is_file():
            subprocess.run([sys.executable, root / "dev", "ui"], cwd=root, check=True)
        built = root / "frontend" / "dist"
        if not (built / "index.html").is_file():
            raise RuntimeError("frontend/dist is missing: the UI was not built. Run ./dev ui, then build again.")
        if self.target_name == "wheel":
            build_data["force_include"][str(built)] = "app/ui"
            build_data["force_include"][str(root / "migrations")] = "app/migrations"
