"""What the logs below a folder are answered, and what each costs.

    ./dev exec python -m bench.logs FOLDER                a line for each file, then the shares
    ./dev exec python -m bench.logs FOLDER --json         the same for a program

Any file counts, whether it is a log or not; of Paparazzi's pairs the .data file, with the .log beside it. What is
compressed (.gz) is unpacked first. Every file is analysed in a process of its own, whose processor time and largest
memory are counted from its start on; where it had to compile a kernel, the file is analysed once more. The codes are
those of docs/from-log-to-gains.md; of a file that is no log, what it is instead. Exits with 1 if one crashed.
"""

import argparse
import gzip
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import threading
import time
import zlib
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

GRADES: Final = ("full", "partial", "description", "refused", "crash")
UNREADABLE: Final = "unreadable"
NOT_A_LOG: Final = "not_a_log"
TRACE: Final = ["trace"]
"""Codes of a trace of the loop, which is compared with the replica alone."""
COMMAND: Final = (sys.executable, "-m", "bench.logs", "--only")
"""Analyses a file, and its companion if there is one, and prints the answer."""
PROCESSOR_S, WALL_S, MEMORY_BYTES = 300, 1200.0, 2**33
"""What a process may take; one that takes more is ended, which is a crash."""
_UNPACKED_BYTES: Final = 2**30


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A file: the grade of its answer, the codes why it is no better, whether the replica was compared, and what the
    process took; of a crash, its last words."""

    file: str
    grade: str
    codes: Sequence[str] = ()
    compared: bool = False
    autopilot: str | None = None
    release: str | None = None
    frame: str | None = None
    processor_s: float
    memory_mb: float
    said: str = ""

    def __str__(self) -> str:
        codes = ", ".join(self.codes) or self.said
        name = self.file.encode(errors="backslashreplace").decode()  # it may be anything
        return f"{self.grade:11} {self.processor_s:5.1f} s {self.memory_mb:5.0f} MB  {name}  {codes}".rstrip()


@dataclass(frozen=True, slots=True)
class Log:
    """A file, and the one with Paparazzi's messages beside it."""

    file: Path
    companion: Path | None = None


def logs_below(folder: Path) -> list[Log]:
    """Every file below a folder, in order; companions with theirs."""
    files = sorted(Path(place, name) for place, _, names in os.walk(folder) for name in names)
    logs = [Log(each, companion_of(each)) for each in files if each.is_file()]
    companions = {each.companion for each in logs}
    return [each for each in logs if each.file not in companions]


def companion_of(file: Path) -> Path | None:
    """The .log file beside a .data file, both compressed or neither; None if there is none."""
    plain = Path(file.name.removesuffix(".gz"))
    beside = file.with_name(plain.with_suffix(".log").name + file.name.removeprefix(plain.name))
    return beside if plain.suffix.lower() == ".data" and beside.is_file() else None


def judge(log: Log) -> Row:
    """Analyse a log in a new process, and again if it compiled what later ones find compiled."""
    row, compiled = _judged(log)
    return _judged(log)[0] if compiled else row


def _judged(log: Log) -> tuple[Row, bool]:
    files = [str(each) for each in (log.file, log.companion) if each is not None]
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as errors:
        process = subprocess.Popen([*COMMAND, *files], stdout=out, stderr=errors)
        ending = threading.Timer(WALL_S, process.kill)
        ending.start()
        _, status, used = os.wait4(process.pid, 0)
        ending.cancel()
        process.returncode = os.waitstatus_to_exitcode(status)  # for its destructor, which else waits again
        out.seek(0)
        errors.seek(0)
        answer = out.read().decode(errors="replace")
        said = errors.read().decode(errors="replace").strip().rpartition("\n")[-1]
    row = Row(
        file=str(log.file),
        grade="crash",
        processor_s=used.ru_utime + used.ru_stime,
        memory_mb=used.ru_maxrss / 1024,
        said=f"signal {-process.returncode}" if process.returncode < 0 else said,
    )
    try:
        found: dict[str, Any] = json.loads(answer) if process.returncode == 0 else {}
        compiled: bool = found.pop("compiled")
    except (ValueError, KeyError, TypeError):
        return row, False
    return replace(row, **found, said=""), compiled


def answer_of(log: Log) -> dict[str, Any]:
    """The answer of a log, in this process."""
    # The process that starts the others imports none of these, so that it stays small.
    from app.autopilots.log_readers import reader_of  # noqa: PLC0415
    from app.core.errors import InputError  # noqa: PLC0415
    from app.log_library.content import analyze_content  # noqa: PLC0415
    from app.log_library.schemas import ReplicaAnswer  # noqa: PLC0415
    from app.logs.base import HEAD_BYTES  # noqa: PLC0415
    from app.logs.formats import recognise  # noqa: PLC0415

    try:
        content, companion = unpacked(log.file), unpacked(log.companion) if log.companion else None
    except (OSError, EOFError, zlib.error):
        return {"grade": "refused", "codes": [UNREADABLE]}
    try:
        answer = analyze_content(content, companion, log.file.name.removesuffix(".gz")).answer
    except InputError as error:
        head = content[:HEAD_BYTES]
        kind = "unusable" if reader_of(head) else getattr(recognise(head), "name", NOT_A_LOG).lower()
        return {"grade": "refused", "codes": sorted({each.code or kind for each in error.problems})}
    return {
        "grade": answer.tuning.grade,
        "codes": sorted({each.code for each in answer.tuning.reasons}) or TRACE * (answer.tuning.grade == "refused"),
        "compared": isinstance(answer.replica, ReplicaAnswer),
        **answer.model_dump(include={"autopilot", "release", "frame"}),
    }


def unpacked(file: Path) -> bytes:
    """The content of a file; a trace (.csv.gz) as it is, which is read compressed."""
    if file.suffix != ".gz" or file.name.endswith(".csv.gz"):
        return file.read_bytes()
    with gzip.open(file) as stream:
        return stream.read(_UNPACKED_BYTES)


def has_compiled(since_s: float) -> bool:
    """Whether a kernel was compiled since then: the folder of machine code has a new file."""
    numba = sys.modules.get("numba")
    return numba is not None and any(
        each.stat().st_mtime >= since_s for each in Path(numba.config.CACHE_DIR).rglob("*.nbc")
    )


def summary(rows: Sequence[Row]) -> dict[str, Any]:
    """Shares of the grades, of all files and of the logs among them; numbers of files by grade and code; the cost."""
    logs = [each for each in rows if NOT_A_LOG not in each.codes]
    return {
        **{
            name: {"number": len(counted), **{grade: _share(counted, grade) for grade in GRADES}}
            for name, counted in (("files", rows), ("logs", logs))
        },
        "codes": {
            grade: dict(Counter(code for each in rows if each.grade == grade for code in each.codes).most_common())
            for grade in GRADES[1:-1]
        },
        "cost": {
            name: {
                f"{which}_{quantity}": round(of(values), 2)
                for quantity in ("processor_s", "memory_mb")
                for which, of in (("median", statistics.median), ("largest", max))
                if (values := [getattr(each, quantity) for each in counted])
            }
            for name, counted in (
                ("answered", [each for each in rows if each.grade in GRADES[:3]]),
                ("refused", [each for each in rows if each.grade == "refused"]),
            )
        },
    }


def _share(rows: Sequence[Row], grade: str) -> float:
    return sum(each.grade == grade for each in rows) / max(len(rows), 1)


def lines_of(found: dict[str, Any]) -> Iterator[str]:
    """The summary for a person."""
    for name in ("files", "logs"):
        shares = ", ".join(f"{grade} {found[name][grade]:.0%}" for grade in GRADES)
        yield f"{found[name]['number']} {name}: {shares}"
    for grade, codes in found["codes"].items():
        if codes:
            yield f"{grade} by: {', '.join(f'{code} {number}' for code, number in codes.items())}"
    for name, cost in found["cost"].items():
        if cost:
            yield (
                f"{name}: processor time {cost['median_processor_s']:.1f} s (median), "
                f"{cost['largest_processor_s']:.1f} s (largest); memory {cost['median_memory_mb']:.0f} MB (median), "
                f"{cost['largest_memory_mb']:.0f} MB (largest)"
            )


def main() -> int:
    parser = argparse.ArgumentParser(prog="bench.logs")
    parser.add_argument("folder", type=Path, nargs="+")
    parser.add_argument("--json", action="store_true", help="print for a program")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--only", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.only:
        return _answer_only(Log(*options.folder))
    for each in options.folder:
        if not each.is_dir():
            parser.error(f"{each} is no folder")
    rows = []
    with ThreadPoolExecutor(options.processes) as pool:
        for row in pool.map(judge, [each for folder in options.folder for each in logs_below(folder)]):
            rows.append(row)
            if not options.json:
                print(row, flush=True)
    found = summary(rows)
    if options.json:
        print(json.dumps({"rows": [asdict(each) for each in rows], **found}, indent=2))
    else:
        print("\n".join(lines_of(found)))
    return int(any(each.grade == "crash" for each in rows))


def _answer_only(log: Log) -> int:
    began_s = time.time()
    resource.setrlimit(resource.RLIMIT_CPU, (PROCESSOR_S, PROCESSOR_S))
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    answer = answer_of(log)
    print(json.dumps({**answer, "compiled": has_compiled(began_s)}))
    return 0


if __name__ == "__main__":
    sys.exit(main())
