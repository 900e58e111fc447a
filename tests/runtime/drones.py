"""Simulated drones in processes of their own, registered with a server as a person does it."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Self

from app.core.experiments.takeoff import WINDOW_S
from tests.ports import free_port
from tests.runtime.processes import Serving, environment, stream
from tests.waiting import Waits, wait_for

OUR_PAGE = {"Sec-Fetch-Site": "same-origin"}
SAFE = {"kp": 283, "ki": 13, "kd": 82}
TRIED = {"kp": 300, "ki": 20, "kd": 90}
SPEED = 2.0
"""Of a drone's time. The ground's is real, so that a busy machine does not make time-outs pass."""
CATCH_UP_S = 0.05
"""What the machine takes from the drone is lost. Caught up, it would be ahead of the ground's clock: the product doubts
a clock that gains 0.1 s."""


class Drone:
    """`gainline sim-drone`: a Paparazzi in the body of a twin, on loopback UDP."""

    def __init__(self, *options: str, speed: float = SPEED) -> None:
        self._ports = free_port(), free_port()
        self._command = [
            *(sys.executable, "-m", "app.cli", "sim-drone", "--vehicle", "twin", "--set", "scatter=0"),
            *("--link", f"udp:127.0.0.1:{self._ports[0]}@{self._ports[1]}", "--speed", str(speed)),
            *("--catch-up", str(CATCH_UP_S), *options),
        ]
        self.switch_on()

    @property
    def pid(self) -> int:
        return self._process.pid

    @property
    def address(self) -> str:
        """As the ground side names it."""
        return f"udp:127.0.0.1:{self._ports[1]}@{self._ports[0]}"

    def switch_on(self) -> None:
        self._process = subprocess.Popen(
            self._command, env=environment(PYTHONUNBUFFERED="1"), stdout=subprocess.PIPE, text=True
        )
        assert self._process.stdout is not None
        assert "Paparazzi" in self._process.stdout.readline()

    def switch_off(self) -> None:
        self._process.send_signal(signal.SIGKILL)
        self._process.wait(Waits.at_most_s)
        assert self._process.stdout is not None
        self._process.stdout.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.switch_off()


@dataclass
class Registered:
    """A drone as a vehicle of a server."""

    serving: Serving
    id: int

    def seen(self) -> Any:
        return self.serving.get(f"/vehicles/{self.id}")

    def in_state(self, *states: str) -> Any:
        """The vehicle, once it is in one of the states."""
        return wait_for(f"the vehicle to be {' or '.join(states)}", lambda: (v := self.seen())["state"] in states and v)

    def act(self, name: str, body: object = None) -> Any:
        """An act, once it is over."""
        asked = self.serving.post(f"/vehicles/{self.id}/{name}", body)

        def over() -> Any:
            done = next(act for act in self.acts() if act["id"] == asked["id"])
            return done if done["state"] in {"done", "failed"} else None

        return wait_for(f"the end of {name}", over)

    def acts(self) -> list[Any]:
        found: list[Any] = self.serving.get(f"/vehicles/{self.id}/acts")["items"]
        return found

    def orders(self) -> list[Any]:
        """To land or to stop its motors, as the books have them, the newest first."""
        return [act for act in self.acts() if act["kind"] in {"land", "motors off"}]

    def campaign(self, window_s: float = WINDOW_S) -> int:
        created = self.serving.post(
            "/campaigns",
            {
                "name": f"On vehicle {self.id}",
                "vehicle": {"kind": "mavlink", "id": self.id},
                "definition": {
                    "experiment_options": {"window_s": window_s},
                    "stop": {"kind": "budget", "max_flights": 7},
                },
            },
        )
        self.serving.proposal(created["id"])
        identity: int = created["id"]
        if created["rehearsal"]["state"] != "not needed":
            self._rehearse(identity)
        return identity

    def _rehearse(self, campaign_id: int) -> None:
        """Fly it on its simulation, as often as is asked for."""
        rehearsal = self.serving.post(f"/campaigns/{campaign_id}/rehearsal")["id"]
        while self.serving.get(f"/campaigns/{campaign_id}")["rehearsal"]["state"] == "under way":
            proposal = self.serving.proposal(rehearsal)
            order = {"proposal_id": proposal["id"], "fly": {"speed": None}}
            self.serving.trial(self.serving.post(f"/campaigns/{rehearsal}/trials", order)["id"], "valid")
        assert self.serving.get(f"/campaigns/{campaign_id}")["rehearsal"]["state"] == "passed"

    def planned(self, campaign_id: int) -> int:
        """A trial of gains other than the safe ones."""
        trial = self.serving.post(f"/campaigns/{campaign_id}/trials", {"gains": TRIED})
        identity: int = trial["id"]
        return identity

    def in_the_air(self, trial_id: int, *, above_m: float = 1.0) -> None:
        """Have the trial flown, and wait until it is up."""
        with stream(self.serving.url) as events:
            self.serving.post(f"/trials/{trial_id}/fly")
            for name, _, data in events:
                if name == "telemetry" and data["trial_id"] == trial_id and data["samples"][-1][1] > above_m:
                    return
        raise AssertionError("the stream ended")

    def status(self, fits: Callable[[Any], bool]) -> Any:
        """The first status on a stream that fits."""
        deadline_s, newest = time.monotonic() + Waits.at_most_s, None
        with stream(self.serving.url) as events:
            for name, _, data in events:
                if name == "vehicle" and data["vehicle_id"] == self.id:
                    newest = data
                    if fits(data):
                        return data
                assert time.monotonic() < deadline_s, newest
        raise AssertionError("the stream ended")

    def session_pid(self) -> int:
        """Of the process that has its link: it holds the vehicle's lock. 0 while it is being signed."""
        signature = (self.serving.data_dir / f"vehicle-{self.id}.lock").read_text()
        pid: int = json.loads(signature)["pid"] if signature else 0
        return pid

    def kill_session(self) -> None:
        os.kill(self.session_pid(), signal.SIGKILL)


def register(serving: Serving, drone: Drone, name: str = "Drone", *, real: bool = False) -> Registered:
    options = {"address": drone.address, "simulated": not real}
    if real:
        serving.unlock()
    confirmed = {"safe_gains_confirmed": True, "statement": "Ada has looked"} if real else {}
    vehicle = serving.post("/vehicles", {"name": name, "kind": "mavlink", "options": options, **confirmed})
    return Registered(serving, vehicle["id"])


@contextmanager
def connected(serving: Serving, name: str, *options: str, real: bool = False) -> Iterator[tuple[Registered, Drone]]:
    """A drone that is there, registered and connected; disconnected at the end."""
    with Drone(*options) as drone:
        vehicle = register(serving, drone, name, real=real)
        done = vehicle.act("connect")
        assert done["state"] == "done", done["problem"]
        yield vehicle, drone
