"""Any file at all: read, or refused with a reason; and large ones within bounded time and memory."""

import io
import random
import resource
import struct
import time
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.autopilots.log_readers import SUFFIXES, read_takeoffs
from app.autopilots.takeoffs import MIN_SAMPLES
from app.core.errors import TrajectoryError
from app.logs import base
from tests.logs.paparazzi_flights import COMPANION, Flight, data_of
from tests.logs.recorded import OnBoardLog, recorded
from tests.logs.test_dataflash_text import PREAMBLE
from tests.logs.test_ulog import small_log

GAINS = {"kp": 283, "ki": 13, "kd": 82}
HEADS = (
    b"",
    struct.pack(">Q", 1_795_222_159_000_000) + b"\xfe",
    struct.pack(">Q", 1_795_222_159_000_000) + b"\xfd",
    OnBoardLog().content,
    b"\xa3\x95\x80",
    b"ULog\x01\x12\x35\x01" + bytes(8),
    b"1.0 31 VERT_LOOP ",
    b"time_s,altitude_m\n",
)


def originals() -> dict[str, bytes]:
    """A short, whole log of every kind."""
    return {
        ".tlog": recorded("paparazzi_283_13_82.tlog")[60_000:140_000],
        ".bin": recorded("arducopter_takeoff.bin")[:400_000],
        ".log": (PREAMBLE + "".join(f"CTUN, {5000 + 50 * row}, 1, {row % 90 / 20}\n" for row in range(400))).encode(),
        ".ulg": small_log(),
        ".data": data_of(Flight(GAINS, fly_s=8.0)).encode(),
    }


ORIGINALS = originals()


def read_or_refuse(content: bytes | Path, companion: bytes | None = None) -> None:
    """Anything raised other than a refusal with a reason fails the test."""
    beside = None if companion is None else io.BytesIO(companion)
    with io.BytesIO(content) if isinstance(content, bytes) else content.open("rb") as stream:
        try:
            takeoffs = read_takeoffs(stream, companion=beside)
        except TrajectoryError as refusal:
            said = bool(refusal.message and refusal.hint)
        else:
            said = all(len(takeoff.trajectory) >= MIN_SAMPLES for takeoff in takeoffs)
    assert said


@pytest.mark.complete
@given(head=st.sampled_from(HEADS), rest=st.binary(max_size=600))
@settings(max_examples=400)
def test_any_bytes_are_read_or_refused_in_words(head: bytes, rest: bytes) -> None:
    read_or_refuse(head + rest)


@pytest.mark.complete
@given(
    kind=st.sampled_from(sorted(ORIGINALS)),
    seed=st.integers(0, 2**32),
    changes=st.integers(1, 60),
    cut=st.floats(0.0, 1.0),
)
@settings(max_examples=150)
def test_a_log_damaged_anywhere_is_read_or_refused_in_words(kind: str, seed: int, changes: int, cut: float) -> None:
    chance = random.Random(seed)
    content = bytearray(ORIGINALS[kind])
    for _ in range(changes):
        place = chance.randrange(len(content))
        match chance.randrange(3):
            case 0:
                content[place] = chance.randrange(256)
            case 1:
                del content[place : place + chance.randrange(200)]
            case _:
                content[place:place] = chance.randbytes(chance.randrange(40))
    read_or_refuse(bytes(content[: max(1, int(cut * len(content)))]))


@pytest.mark.complete
@given(
    companion=st.one_of(
        st.binary(max_size=300), st.text(max_size=200).map(lambda text: COMPANION[:400].encode() + text.encode())
    )
)
@settings(max_examples=100)
def test_any_companion_is_read_or_refused_in_words(companion: bytes) -> None:
    read_or_refuse(ORIGINALS[".data"], companion=companion)


@pytest.mark.parametrize("suffix", [each for each in SUFFIXES[1:] if each != ".log"])
def test_a_file_with_the_wrong_extension_is_refused_by_name(suffix: str) -> None:
    for content, reason in ((b"", "is empty"), (b"time_s,altitude_m\n0,0\n", "does not start like")):
        with pytest.raises(
            TrajectoryError, match=rf"flight\{suffix} does not match its file extension. file: {reason}"
        ):
            read_takeoffs(io.BytesIO(content), name=f"flight{suffix}")


def test_a_companion_without_its_record_is_refused_as_such() -> None:
    with pytest.raises(TrajectoryError, match=r"flight\.log contains no flight\. .*choose both"):
        read_takeoffs(io.BytesIO(COMPANION.encode()), name="flight.log")


def test_the_content_decides_whatever_the_name_is() -> None:
    assert read_takeoffs(io.BytesIO(recorded("arducopter_takeoff.bin")), name="flight.csv")[0].gains


def test_a_log_beyond_half_a_gibibyte_is_refused_before_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "huge.bin"
    path.write_bytes(OnBoardLog().content)
    with path.open("r+b") as stream:
        stream.truncate(base.MAX_BYTES + 1)
        stream.seek(0)
        with pytest.raises(TrajectoryError, match="is larger than 512 MiB"):
            read_takeoffs(stream)


def repeated(head: bytes, body: bytes, path: Path, size: int) -> Path:
    """A file of about `size` bytes: a head, and a body again and again."""
    with path.open("wb") as stream:
        stream.write(head)
        for _ in range(size // len(body)):
            stream.write(body)
    return path


@pytest.mark.complete
@pytest.mark.parametrize("kind", sorted(ORIGINALS))
def test_tens_of_megabytes_take_bounded_time_and_memory(kind: str, tmp_path: Path) -> None:
    wholes = {
        ".tlog": recorded("paparazzi_283_13_82.tlog"),
        ".bin": recorded("arducopter_takeoff.bin"),
        ".ulg": recorded("px4_takeoff.ulg"),
        ".data": data_of(Flight(GAINS)).encode(),
    }
    whole = wholes.get(kind, ORIGINALS[kind])
    head = whole[:16] if kind == ".ulg" else b""
    path = repeated(head, whole[len(head) :], tmp_path / f"huge{kind}", 40_000_000)
    before_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    began_s = time.process_time()
    read_or_refuse(path)
    assert time.process_time() - began_s < 48.0
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kib < 280_000
