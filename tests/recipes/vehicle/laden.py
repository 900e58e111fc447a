"""The twin with a load below it: an example of a simulated vehicle."""

from typing import Final

from app.core.definition import Option
from app.vehicles.kinds import VehicleKind
from app.vehicles.simulated import Simulation, opener
from app.vehicles.twin import TWIN, TwinFlight

_TWIN: Final = {option.name: float(option.default) for option in TWIN.options}


def _launch(options: dict[str, float], seed: int) -> Simulation:
    return TwinFlight({**_TWIN, "scatter": options["scatter"], "hover_throttle": 0.63}, seed)


LADEN: Final = VehicleKind(
    name="laden",
    title="Laden twin",
    line="The twin with a load, which hovers with more thrust.",
    is_real=False,
    experiments=("takeoff",),
    options=(Option("scatter", "Flight-to-flight scatter", 1.0, "×", 0.0, 5.0),),
    open=opener("laden", _launch),
)
