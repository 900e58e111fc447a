"""Opening of a second source of altitude by its address."""

from app.core.clock import Clock
from app.vehicles.mavlink.altitude_sources import AltitudeSource
from app.vehicles.mocap.addresses import NatNetAddress, OdometryAddress, StreamAddress, parse
from app.vehicles.mocap.natnet import NatNetSource
from app.vehicles.mocap.odometry import OdometrySource, StreamSource


def open_source(text: str, clock: Clock) -> AltitudeSource:
    """Open the source at this address. Raises InputError for an invalid address, VehicleError if nothing is received
    there; odometry on the vehicle's own link is not waited for."""
    match parse(text):
        case NatNetAddress() as address:
            return NatNetSource(address, clock)
        case OdometryAddress():
            return OdometrySource("odometry on the vehicle's own link", clock)
        case StreamAddress() as address:
            return StreamSource(address, clock)
