"""Errors of vehicles.

GainlineError
└── VehicleError                  a vehicle could not do what was asked
    ├── InterruptedByOrderError   a person ordered something else meanwhile
    └── SafeGainsError            it may still hold experimental gains: to be quarantined
"""

from app.core.errors import GainlineError


class VehicleError(GainlineError):
    """A vehicle could not do what was asked of it. `not_flown`: that was to fly, and it was never told to take off."""

    not_flown = False


class InterruptedByOrderError(VehicleError):
    """What was under way with the vehicle was ended by a person's order to land or to stop its motors, which has gone
    out."""


class SafeGainsError(VehicleError):
    """The safe gains could not be verified on the vehicle; it must not fly until a person has looked at it."""
