"""Addresses under which other devices reach this server, what that exposes, and their QR codes: as SVG for a page, as
text for a terminal.
"""

import io
import ipaddress
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from app.common.schemas import Schema
from app.common.settings import is_loopback

EXPOSES: Final = (
    "anyone who can reach this computer over the network can view every campaign. Browsers unlocked with `gainline "
    "unlock` can change and delete campaigns and start simulated flights. Gainline has no user accounts. "
    "Vehicles with a link, real or simulated, fly only from a browser on the computer that runs the server, which then "
    "listens on loopback (--host 127.0.0.1)."
)
"""Consequence of listening beyond loopback, as the second half of a sentence."""

_EVERYWHERE: Final = {"0.0.0.0": 4, "::": 6}  # noqa: S104 - compared, not bound
_INTERNAL: Final = ("docker", "br-", "veth", "virbr")
"""Interfaces that lead to containers and virtual machines on this machine only."""


class AddressInfo(Schema):
    """An address of this server. `interface` is empty where the server listens on a name or on one address."""

    url: str
    interface: str


def web_address(host: str, port: int) -> str:
    """Web address for a browser on this machine."""
    shown = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(host, host)  # noqa: S104 - compared, not bound
    return f"http://[{shown}]:{port}" if ":" in shown else f"http://{shown}:{port}"


def unlock_link(address: str, token: str) -> str:
    """The link that unlocks the browser that opens it."""
    return f"{address}/unlock?token={token}"


def exposure(host: str) -> str | None:
    """Warning about what listening on this host exposes; None on loopback."""
    return None if is_loopback(host) else f"Warning: listening on {host}, so {EXPOSES}"


def addresses_elsewhere(host: str, port: int) -> list[AddressInfo]:
    """Addresses under which other devices reach a server that listens there, the likeliest first; none on loopback.

    In a container they are the container's own, which are not reachable from other hosts unless it shares the host's
    network.
    """
    if is_loopback(host):
        return []
    version = _EVERYWHERE.get(host)
    if version is None:
        return [AddressInfo(url=web_address(host, port), interface="")]
    found = sorted(_own_addresses(version), key=lambda one: one[0].is_link_local)
    return [AddressInfo(url=web_address(str(address), port), interface=interface) for address, interface in found]


def is_in_container() -> bool:
    """Whether this process runs in a container of Docker or Podman."""
    return any(Path(mark).exists() for mark in ("/.dockerenv", "/run/.containerenv"))


def _own_addresses(version: int) -> Iterator[tuple[ipaddress.IPv4Address | ipaddress.IPv6Address, str]]:
    import ifaddr

    for adapter in ifaddr.get_adapters():
        if adapter.nice_name.startswith(_INTERNAL):
            continue
        for each in adapter.ips:
            address = ipaddress.ip_address(each.ip if isinstance(each.ip, str) else each.ip[0])
            # A link-local IPv6 address needs an interface name of the other device.
            unusable = address.is_loopback or (address.version == 6 and address.is_link_local)
            if address.version == version and not unusable:
                yield address, adapter.nice_name


_WHITE_ON_BLACK: Final = "\x1b[97;40m"
_RESET: Final = "\x1b[0m"


def qr_svg(text: str) -> bytes:
    """SVG of dark modules on white with the quiet zone that readers need, so that it also works on a dark page."""
    import segno

    drawn = io.BytesIO()
    segno.make_qr(text).save(drawn, kind="svg", border=4, dark="#000", light="#fff", omitsize=True, title=text)
    return drawn.getvalue()


def qr_text(text: str) -> str:
    """The code in half blocks, white on black whatever the terminal's colours."""
    import segno

    drawn = io.StringIO()
    segno.make_qr(text).terminal(drawn, border=2, compact=True)
    return "\n".join(f"{_WHITE_ON_BLACK}{line}{_RESET}" for line in drawn.getvalue().splitlines())
