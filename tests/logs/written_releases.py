"""ArduCopter's logs in the format of each of its releases: messages, columns, units, clock and names of parameters."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from tests.logs.copter_motions import Motion
from tests.logs.recorded import OnBoardLog

_Write = Callable[[float], None]

_CODES: Final = {
    **{each: each for each in "bBhHiIqQfd"},
    "M": "B", "c": "h", "C": "H", "e": "i", "E": "I", "n": "4s", "N": "16s", "Z": "64s",
}  # fmt: skip
_SCALED: Final = "cCeE"
_INTEGERS: Final = "bBhHiIqQMcCeE"

ATT: Final = ("QccccCC", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw")
CTUN: Final = "TimeUS,ThI,ABst,ThO,ThH,DAlt,Alt,BAlt,DSAlt,SAlt,TAlt,DCRt,CRt"
RATE: Final = ("Qffffffffffff", "TimeUS,RDes,R,ROut,PDes,P,POut,YDes,Y,YOut,ADes,A,AOut")
PSCD: Final = "TimeUS,TPD,PD,DVD,TVD,VD,DAD,TAD,AD"
TIMED: Final = {
    "PARM": ("QNf", "TimeUS,Name,Value"),
    "MSG": ("QZ", "TimeUS,Message"),
    "MODE": ("QMBB", "TimeUS,Mode,ModeNum,Rsn"),
    "EV": ("QB", "TimeUS,Id"),
}
UNTIMED: Final = {
    "PARM": ("Nf", "Name,Value"),
    "MSG": ("Z", "Message"),
    "MODE": ("Mh", "Mode,ThrCrs"),
    "EV": ("B", "Id"),
}
_OLD_CTUN: Final = "ThrIn,AngBst,ThrOut,DAlt,Alt,BarAlt,DSAlt,SAlt,DCRt,CRt"
_ACCEL: Final = {f"PSC_ACCZ_{each}": (f"ACCEL_Z_{each}", 1.0) for each in ("P", "I")}
NAMES_3_2: Final = {"PSC_POSZ_P": ("THR_ALT_P", 1.0), "PSC_VELZ_P": ("THR_RATE_P", 1.0)} | {
    f"PSC_ACCZ_{each}": (f"THR_ACCEL_{each}", 1.0) for each in ("P", "I")
}
NAMES_3_3: Final = {"PSC_POSZ_P": ("POS_Z_P", 1.0), "PSC_VELZ_P": ("VEL_Z_P", 1.0), **_ACCEL}
NAMES_4_7: Final = {
    "PSC_POSZ_P": ("PSC_D_POS_P", 1.0),
    "PSC_VELZ_P": ("PSC_D_VEL_P", 1.0),
    "PSC_ACCZ_P": ("PSC_D_ACC_P", 0.1),
    "PSC_ACCZ_I": ("PSC_D_ACC_I", 0.1),
    "PSC_ACCZ_FLTE": ("PSC_D_ACC_FLTE", 1.0),
    "PSC_VELZ_I": ("PSC_D_VEL_I", 1.0),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Release:
    """A format: `messages` by name with the letters and names of their columns, parameters whose `names` and factors
    differ from those of releases 4.0 to 4.6, more of its `parameters`, and the units by message and column (3.6 and
    later), of which `B` is 0.01."""

    banner: str
    messages: Mapping[str, tuple[str, str]]
    names: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)
    scales: Mapping[str, str] = field(default_factory=dict)

    def log(
        self,
        motion: Motion,
        *,
        parameters: Mapping[str, float] | None = None,
        rate_every: int = 1,
        loop_until_s: float = np.inf,
    ) -> bytes:
        """The log of a flight with these parameters beside its gains; of RATE only some rows, and of the loop's own
        message, as in modes in which a release does not log it, those until a time."""
        log = _Log(self.messages)
        log.describe(self.scales)
        log.row("MSG", 0.0, Message=self.banner)
        settings = {"MOT_THST_HOVER": 0.4, **self.parameters, **(parameters or {})}
        own = {self.names.get(name, (name, 1.0)): value for name, value in {**motion.gains, **settings}.items()}
        for (name, factor), value in own.items():
            log.row("PARM", 0.0, Name=name, Value=factor * value)
        for at_s, write in sorted(self._rows(log, motion, rate_every, loop_until_s), key=lambda row: row[0]):
            write(at_s)
        return log.content

    def _rows(
        self, log: "_Log", motion: Motion, rate_every: int, loop_until_s: float
    ) -> Sequence[tuple[float, _Write]]:
        modes = [(at_s, log.writer("MODE", Mode=mode, ModeNum=mode)) for at_s, mode in motion.modes]
        events = [(at_s, log.writer("EV", Id=number)) for at_s, number in motion.events]
        rows = [
            (at_s, log.writer(message, **_columns(motion, row)))
            for row, at_s in enumerate(motion.time_s.tolist())
            for message in ("CTUN", "RATE", "PSCZ", "PSCD", "ATT")
            if message in self.messages
            if message != "RATE" or row % rate_every == 0
            if not message.startswith("PSC") or at_s < loop_until_s
        ]
        return [*modes, *events, *rows]


def _columns(motion: Motion, row: int) -> dict[str, float]:
    """All columns that a release may have of a row, in the unit of the log."""
    z, v, a, z_d, v_d, v_t, a_d, a_t, throttle, filtered, hover = (
        float(each[row])
        for each in (
            motion.z_m, motion.v_m_s, motion.a_m_s2, motion.z_d_m, motion.v_d_m_s, motion.v_t_m_s, motion.a_d_m_s2,
            motion.a_t_m_s2, motion.throttle, motion.throttle_filtered, motion.hover,
        )
    )  # fmt: skip
    up = {"TPZ": z_d, "PZ": z, "DVZ": v_d, "TVZ": v_t, "VZ": v, "DAZ": a_d, "TAZ": a_t, "AZ": a}
    down = {f"{name[:-1]}D": -value for name, value in up.items()} | {"DPD": -z_d}
    tuning = {
        "ThI": throttle, "ThO": filtered, "ThH": hover, "Alt": z, "DAlt": z_d, "BAlt": z, "BarAlt": z, "CRt": 100.0 * v,
        "DCRt": 100.0 * v_t, "ThrIn": 500.0, "ThrOut": 1000.0 * filtered, "N": 80.0,
    }  # fmt: skip
    return {**up, **down, **tuning, "A": 100.0 * a, "ADes": 100.0 * a_t, "AOut": filtered}


class _Log(OnBoardLog):
    def __init__(self, messages: Mapping[str, tuple[str, str]]) -> None:
        super().__init__()
        self._kinds = {name: (number, *each) for number, (name, each) in enumerate(messages.items(), start=10)}
        for name, (number, letters, columns) in self._kinds.items():
            self.define(number, name, letters, columns)

    def describe(self, scales: Mapping[str, str]) -> None:
        """The multipliers of columns, by message; none if no message has any."""
        if not scales:
            return
        self.define(1, "FMTU", "QBNN", "TimeUS,FmtType,UnitIds,MultIds")
        self.define(2, "MULT", "Qbd", "TimeUS,Id,Mult")
        for letter, factor in (("F", 1e-6), ("B", 1e-2), ("-", 0.0), ("0", 1.0), ("2", 100.0)):
            self.add(2, "<Qbd", 0, ord(letter), factor)
        for name, multipliers in scales.items():
            units = "".join("%" if each == "2" else "n" for each in multipliers)
            self.add(1, "<QB16s16s", 0, self._kinds[name][0], units.encode(), multipliers.encode())

    def writer(self, name: str, **values: float) -> _Write:
        return lambda at_s: self.row(name, at_s, **values)

    def row(self, name: str, at_s: float, **values: float | str) -> None:
        """A row of a message that the release has; 0 in the columns that are not given."""
        number, letters, columns = self._kinds[name]
        given = {"TimeUS": round(1e6 * at_s), "TimeMS": round(1e3 * at_s), **values}
        packed = [_packed(letter, given.get(each, 0)) for letter, each in zip(letters, columns.split(","), strict=True)]
        self.add(number, "<" + "".join(_CODES[each] for each in letters), *packed)


def _packed(letter: str, value: float | str) -> float | bytes:
    """Integers are cut off, as the firmware does."""
    if isinstance(value, str):
        return value.encode()
    scaled = 100.0 * value if letter in _SCALED else value
    return int(scaled) if letter in _INTEGERS else float(np.float32(scaled)) if letter == "f" else scaled


_SINCE_4_1: Final = {"PSC_VELZ_I": 0.0, "PSC_JERK_Z": 5.0, "FRAME_CLASS": 1.0, "LOG_BITMASK": 176126.0}
_UNTIL_4_0: Final = {"LOG_BITMASK": 176126.0}
_MESSAGES_SINCE_4_6: Final = {
    **TIMED,
    "CTUN": ("Qffffffeccfhh", CTUN),
    "RATE": RATE,
    "PSCD": ("Qfffffffff", PSCD.replace("TPD", "DPD,TPD")),
    "ATT": ("Qffff", "TimeUS,DesRoll,Roll,DesPitch,Pitch"),
}
_CENTI: Final = {"CTUN": "F-----0BBB0BB", "RATE": "F---------BB0"}

RELEASES: Final[Mapping[str, Release]] = {
    "3.1": Release(
        banner="ArduCopter V3.1.3 (0a1b2c3d)",
        messages={
            **UNTIMED,
            "CTUN": ("Ihhhffecchh", f"TimeMS,{_OLD_CTUN}"),
            "ATT": ("IccccCC", ATT[1].replace("TimeUS", "TimeMS")),
        },
        names=NAMES_3_2,
        parameters={"FRAME": 10.0, "LOG_BITMASK": 958.0},
    ),
    "3.3": Release(
        banner="APM:Copter V3.3.3 (0a1b2c3d)",
        messages={
            **TIMED,
            "MODE": ("QMB", "TimeUS,Mode,ModeNum"),
            "CTUN": ("Qhhfffecchh", f"TimeUS,{_OLD_CTUN}"),
            "ATT": ATT,
        },
        names={**NAMES_3_3, "PSC_ACCZ_FLTE": ("ACCEL_Z_FILT_HZ", 1.0)},
        parameters={"FRAME": 1.0, "THR_MID": 500.0, **_UNTIL_4_0},
    ),
    "3.4": Release(
        banner="APM:Copter V3.4.4-rc1 (0a1b2c3d)",
        messages={**TIMED, "CTUN": ("Qffffffeccfhh", CTUN), "RATE": RATE, "ATT": ATT},
        names={**NAMES_3_3, "PSC_ACCZ_FLTE": ("ACCEL_Z_FILT", 1.0)},
        parameters={"FRAME": 1.0, "PSC_ACC_XY_FILT": 2.0, **_UNTIL_4_0},
    ),
    "3.6": Release(
        banner="ArduCopter V3.6.4 (0a1b2c3d)",
        messages={**TIMED, "CTUN": ("Qffffffeccfhh", CTUN), "RATE": RATE, "ATT": ATT},
        names={"PSC_ACCZ_FLTE": ("PSC_ACCZ_FILT", 1.0)},
        parameters={"FRAME_CLASS": 1.0, "PSC_ACC_XY_FILT": 2.0, **_UNTIL_4_0},
        scales={**_CENTI, "ATT": "FBBBBBB"},
    ),
    "4.0": Release(
        banner="ArduCopter V4.0.7 (0a1b2c3d)",
        messages={**TIMED, "CTUN": ("Qffffffeccfhhf", f"{CTUN},N"), "RATE": RATE, "ATT": ATT},
        parameters={"FRAME_CLASS": 1.0, "PSC_ACCZ_FLTT": 0.0, **_UNTIL_4_0},
        scales={"CTUN": f"{_CENTI['CTUN']}-", "RATE": _CENTI["RATE"]},
    ),
    "4.1": Release(
        banner="ArduCopter V4.1.0-dev (0a1b2c3d)",
        messages={
            **TIMED,
            "CTUN": ("Qffffffeccfhh", CTUN),
            "RATE": RATE,
            "PSCZ": ("Qfffffffff", "TimeUS,TPZ,PZ,DVZ,TVZ,VZ,DAZ,TAZ,AZ,ThO"),
            "ATT": ATT,
        },
        parameters=_SINCE_4_1,
        scales=_CENTI,
    ),
    "4.2": Release(
        banner="ArduCopter V4.2.3 (0a1b2c3d)",
        messages={**TIMED, "CTUN": ("Qffffffeccfhh", CTUN), "RATE": RATE, "PSCD": ("Qffffffff", PSCD), "ATT": ATT},
        parameters=_SINCE_4_1,
        scales=_CENTI,
    ),
    "4.6": Release(
        banner="ArduCopter V4.6.0 (0a1b2c3d)",
        messages=_MESSAGES_SINCE_4_6,
        parameters=_SINCE_4_1,
        scales=_CENTI,
    ),
    "4.7": Release(
        banner="ArduCopter V4.7.0 (0a1b2c3d)",
        messages=_MESSAGES_SINCE_4_6,
        names=NAMES_4_7,
        parameters=_SINCE_4_1,
        scales=_CENTI,
    ),
}
