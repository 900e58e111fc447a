"""Add what CONTRIBUTING.md says how to add, as it says, and run the tests that use it: `python -m tests.recipes.run
RECIPE…`."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from tests.recipes.additions import Change, add, line

HERE: Final = Path(__file__).parent


@dataclass(frozen=True, slots=True, kw_only=True)
class Recipe:
    """What is added: modules by the files in which they stand, below the recipe's folder, and lines in others; `given`
    are those of another recipe that this one builds on. `tests` are run besides those in `used.py`."""

    added: dict[str, str]
    changes: tuple[Change, ...]
    given: tuple[Change, ...] = ()
    tests: tuple[str, ...] = ()


STRATEGIES, EXPERIMENTS = "app.core.tuning.strategies", "app.core.experiments"
PROFILE, VEHICLES = "app.autopilots.paparazzi.profile", "app.vehicles.registry"
FORMATS, READERS, AUTOPILOTS = "app.logs.formats", "app.autopilots.log_readers", "app.autopilots.registry"

REPLICAS = "app.autopilots.replicas"
TOY: Final = (
    line(AUTOPILOTS, "from app.autopilots.toy.profile import TOY", before="from app.core.definition"),
    Change(AUTOPILOTS, "(PAPARAZZI, ARDUPILOT, PX4)", "(PAPARAZZI, ARDUPILOT, PX4, TOY)"),
)

RECIPES: Final = {
    "strategy": Recipe(
        added={f"{STRATEGIES}.gentler": "gentler.py"},
        changes=(
            line(STRATEGIES, f"from {STRATEGIES}.gentler import GENTLER", before=f"from {STRATEGIES}.gradient"),
            Change(STRATEGIES, "(CALIBRATED, GRADIENT,", "(CALIBRATED, GRADIENT, GENTLER,"),
        ),
    ),
    "experiment": Recipe(
        added={f"{EXPERIMENTS}.small_steps": "small_steps.py"},
        changes=(
            line(PROFILE, f"from {EXPERIMENTS}.small_steps import SmallSteps", before=f"from {EXPERIMENTS}.takeoff"),
            Change(PROFILE, "(Takeoff(), AltitudeSteps())", "(Takeoff(), AltitudeSteps(), SmallSteps())"),
            Change(
                "app.vehicles.twin", '("takeoff", "altitude-steps")', '("takeoff", "altitude-steps", "small-steps")'
            ),
        ),
    ),
    "vehicle": Recipe(
        added={"app.vehicles.laden": "laden.py"},
        changes=(
            line(VEHICLES, "from app.vehicles.laden import LADEN", before="from app.vehicles.mavlink_kind"),
            Change(VEHICLES, "(JSBSIM, TWIN,", "(JSBSIM, TWIN, LADEN,"),
            line(
                "tests.vehicles.flying",
                '    "laden": Profile(scattered={"scatter": 1.0}),',
                before='    "lti": Profile(',
            ),
        ),
        tests=("-k", "laden", "tests/vehicles/test_contract.py"),
    ),
    "autopilot": Recipe(
        added={"app.autopilots.toy": "."},
        changes=TOY,
    ),
    "log_format": Recipe(
        added={"app.logs.text_log": "text_log.py", "app.autopilots.paparazzi.text": "text.py"},
        changes=(
            line(FORMATS, "from app.logs.text_log import is_text_log", before="from app.logs.tlog"),
            line(FORMATS, '    TEXT = ".txt"', before="    GZIP ="),
            line(FORMATS, "    (Format.TEXT, is_text_log),", before="    (Format.GROUND_LOG, is_ground_log)"),
            line(
                READERS,
                "from app.autopilots.paparazzi.text import TEXT",
                before="from app.autopilots.px4.logged_flight",
            ),
            line(READERS, "    Format.TEXT: Reader(**TEXT),", before="    Format.GROUND_LOG: Reader("),
        ),
    ),
    "replica": Recipe(
        added={
            "app.autopilots.toy": "../autopilot",
            "app.autopilots.toy.replica": ".",
            "app.autopilots.toy.replica_check": "replica_check.py",
        },
        given=TOY,
        changes=(
            line(
                REPLICAS, "from app.autopilots.toy import replica_check as toy", before="from app.autopilots.replica_"
            ),
            line(REPLICAS, "from app.autopilots.toy.profile import TOY", before="\nREPLICAS: Final"),
            Change(REPLICAS, "PAPARAZZI: paparazzi.REPLICA", "PAPARAZZI: paparazzi.REPLICA, TOY: toy.REPLICA"),
        ),
    ),
    "figure": Recipe(
        added={"app.figures.flown_order": "flown_order.py"},
        changes=(
            line(
                "app.figures", "from app.figures.flown_order import FlownOrderFigure", before="from app.figures.gains"
            ),
            line("app.figures", '    "order": FlownOrderFigure,', before='    "gains": GainsFigure'),
            Change("app.figures", '"errors", "gains"]', '"errors", "gains", "order"]'),
        ),
    ),
}


def run(names: Sequence[str]) -> int:
    recipes = {HERE / name: RECIPES[name] for name in names}
    add(
        {module: folder / file for folder, recipe in recipes.items() for module, file in recipe.added.items()},
        *(change for recipe in recipes.values() for change in (*recipe.given, *recipe.changes)),
    )
    import pytest

    options = ("-q", "-n", "0", "-p", "no:cacheprovider")
    codes = [pytest.main([*options, *(str(folder / "used.py") for folder in recipes)])]
    codes += [pytest.main([*options, *recipe.tests]) for recipe in recipes.values() if recipe.tests]
    return max(codes)


if __name__ == "__main__":
    sys.exit(run(sys.argv[1:]))
