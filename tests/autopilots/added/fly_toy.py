"""Add the toy as docs say, a folder in app/autopilots and a line in its registry, and use it: a process of its own."""

import json
import sys
from pathlib import Path
from types import ModuleType

import app.autopilots

HERE = Path(__file__).parent
REGISTRY = "app.autopilots.registry"
LINE = ("(PAPARAZZI, ARDUPILOT, PX4)", "(PAPARAZZI, ARDUPILOT, PX4, TOY)")


def add_toy() -> None:
    app.autopilots.__path__.append(str(HERE))
    [folder] = app.autopilots.__path__[:1]
    source = (Path(folder) / "registry.py").read_text()
    assert LINE[0] in source
    module = sys.modules[REGISTRY] = ModuleType(REGISTRY)
    added = source.replace(*LINE).replace(
        "from app.autopilots.px4.profile import PX4\n",
        "from app.autopilots.px4.profile import PX4\nfrom app.autopilots.toy.profile import TOY\n",
    )
    exec(compile(added, REGISTRY, "exec"), module.__dict__)


def use_toy() -> dict[str, object]:
    """What the catalogue offers of it, and what it does on the link in time of its own."""
    from app.campaigns.catalogue import get_catalogue
    from app.vehicles.base import FlightOptions
    from tests.vehicles.flying import never, unwatched
    from tests.vehicles.mavlink.rigs import LockstepRig

    safe, tuned = {"kp": 283.0, "ki": 13.0, "kd": 82.0}, {"kp": 400.0, "ki": 20.0, "kd": 90.0}
    [offered] = [each for each in get_catalogue().autopilots if each.name == "toy"]
    with LockstepRig("toy") as rig:
        vehicle = rig.vehicle(safe)
        failed = [item.name for item in vehicle.check() if not item.passed]
        staged, on_board = vehicle.stage(tuned), rig.drone.autopilot.parameters["TOY_P"]
        record = vehicle.fly(FlightOptions(seed=1, window_s=12.0), on_sample=unwatched, should_stop=never)
        held = vehicle.read_gains()
        vehicle.close()
    flown = record.trajectory
    return {
        "experiments": offered.experiments,
        "address": offered.address,
        "failed": failed,
        "staged": staged,
        "on board": on_board,
        "ending": record.ending,
        "reason": record.reason,
        "end_m": float(flown["altitude_m"][flown.time_s > 10.0].mean()),
        "held": held,
        "armed": rig.drone.autopilot.armed,
    }


if __name__ == "__main__":
    add_toy()
    json.dump(use_toy(), sys.stdout)
