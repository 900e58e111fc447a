"""Identity: whether two vehicles answer, and whether the vehicle has rebooted."""

from dataclasses import dataclass

from app.vehicles.mavlink.failures import Failure, Finding


@dataclass(frozen=True, kw_only=True)
class IdentityMonitor:
    """`duplicate_reason` is the evidence that two vehicles use its system id; empty without evidence."""

    duplicate_reason: str = ""
    rebooted: bool = False

    def find_duplicate(self) -> Finding | None:
        return Finding(Failure.DUPLICATE, self.duplicate_reason) if self.duplicate_reason else None

    def find_reboot(self) -> Finding | None:
        return Finding(Failure.UNEXPECTED, "The vehicle rebooted.") if self.rebooted else None
