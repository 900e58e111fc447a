"""The analysis of every log below a folder: which files count, what a crash is, and the shares."""

import gzip
import json
import sys
from pathlib import Path
from typing import Any

import pytest

from bench import logs
from bench.logs import Log, Row, judge, lines_of, logs_below, main, summary
from tests.log_library.fleet import HOVERS

ANSWER = {"grade": "partial", "codes": ["too_short"], "compared": True, "compiled": False}


def answering(monkeypatch: pytest.MonkeyPatch, code: str) -> None:
    """Instead of the analysis this runs in the new process, with the names of the files as its arguments."""
    monkeypatch.setattr(logs, "COMMAND", (sys.executable, "-S", "-c", code))


def told(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *options: str) -> tuple[int, str]:
    monkeypatch.setattr(sys, "argv", ["bench.logs", *options])
    return main(), capsys.readouterr().out


def row(grade: str, *codes: str, processor_s: float = 1.0, memory_mb: float = 100.0) -> Row:
    return Row(file="flight.bin", grade=grade, codes=codes, processor_s=processor_s, memory_mb=memory_mb)


def test_every_file_counts_and_companions_with_theirs(tmp_path: Path) -> None:
    names = ("a.bin", "b/c.data", "b/c.log", "b/d.data", "b/e.log", "b/f.DATA.gz", "b/f.log.gz", "b/README.md")
    for name in names:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    (tmp_path / "gone.bin").symlink_to("nowhere")
    found = {
        str(each.file.relative_to(tmp_path)): each.companion and each.companion.name for each in logs_below(tmp_path)
    }
    assert found == {
        "a.bin": None,
        "b/README.md": None,
        "b/c.data": "c.log",
        "b/d.data": None,
        "b/e.log": None,
        "b/f.DATA.gz": "f.log.gz",
    }


def test_a_row_is_what_the_process_answers_and_takes(monkeypatch: pytest.MonkeyPatch) -> None:
    answering(monkeypatch, f"print({json.dumps(ANSWER)!r})")
    found = judge(Log(Path("steps.bin")))
    assert (found.grade, found.codes, found.compared) == ("partial", ["too_short"], True)
    assert 0.0 < found.processor_s < 5.0
    assert found.memory_mb > 1.0
    assert str(found).endswith("MB  steps.bin  too_short")


def test_a_log_for_which_a_kernel_was_compiled_is_analysed_again(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    count = tmp_path / "count"
    monkeypatch.chdir(tmp_path)
    first = json.dumps({**ANSWER, "compiled": True})
    answering(monkeypatch, f"open('count', 'a').write('x'); print({first!r})")
    assert judge(Log(Path("steps.bin"))).grade == "partial"
    assert count.read_text() == "xx"


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("import os; os.abort()", "signal 6"),
        ("raise ValueError('odd')", "ValueError: odd"),
        ("import sys; sys.exit(3)", ""),
        ("print('{')", ""),
        ("print('[1]')", ""),
        ("print()", ""),
    ],
)
def test_a_crash_is_a_row_of_its_own_and_stops_nothing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path, code: str, said: str
) -> None:
    for name in ("a.bin", "b.bin"):
        (tmp_path / name).touch()
    answering(monkeypatch, f"import sys\nif sys.argv[1].endswith('a.bin'): {code}\nelse: print({json.dumps(ANSWER)!r})")
    status, out = told(monkeypatch, capsys, str(tmp_path), "--json")
    found: dict[str, Any] = json.loads(out)
    assert status == 1
    assert [(each["grade"], each["said"]) for each in found["rows"]] == [("crash", said), ("partial", "")]
    shares = {"full": 0.0, "partial": 0.5, "description": 0.0, "refused": 0.0, "crash": 0.5}
    assert found["files"] == found["logs"] == {"number": 2, **shares}


def test_the_shares_are_of_all_files_and_the_codes_by_grade() -> None:
    found = summary(
        [
            row("full", processor_s=4.0, memory_mb=240.0),
            row("partial", "too_short", "gaps", processor_s=2.0),
            row("refused", "no_data", processor_s=0.5, memory_mb=60.0),
            row("refused", "no_data", processor_s=0.7, memory_mb=80.0),
            row("refused", "not_a_log", processor_s=0.6, memory_mb=70.0),
        ]
    )
    assert found["codes"] == {
        "partial": {"too_short": 1, "gaps": 1},
        "description": {},
        "refused": {"no_data": 2, "not_a_log": 1},
    }
    assert found["cost"]["answered"]["largest_processor_s"] == 4.0
    assert list(lines_of(found)) == [
        "5 files: full 20%, partial 20%, description 0%, refused 60%, crash 0%",
        "4 logs: full 25%, partial 25%, description 0%, refused 50%, crash 0%",
        "partial by: too_short 1, gaps 1",
        "refused by: no_data 2, not_a_log 1",
        "answered: processor time 3.0 s (median), 4.0 s (largest); memory 170 MB (median), 240 MB (largest)",
        "refused: processor time 0.6 s (median), 0.7 s (largest); memory 70 MB (median), 80 MB (largest)",
    ]
    none = "full 0%, partial 0%, description 0%, refused 0%, crash 0%"
    assert list(lines_of(summary([]))) == [f"0 files: {none}", f"0 logs: {none}"]


@pytest.mark.complete
def test_logs_and_what_is_none_are_graded(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    contents = {
        "hover.tlog.gz": gzip.compress(HOVERS.content),
        "notes.txt": b"hello",
        "zeros.bin": bytes(1000),
        "cut.tlog.gz": gzip.compress(HOVERS.content)[:-50],
        "odd\udcff.bin": b"hello",
    }
    for name, content in contents.items():
        (tmp_path / name).write_bytes(content)
    status, out = told(monkeypatch, capsys, str(tmp_path), "--json")
    found = {Path(each["file"]).name: (each["grade"], *each["codes"]) for each in json.loads(out)["rows"]}
    assert status == 0
    assert found.pop("hover.tlog.gz")[0] == "partial"
    assert found == {
        "notes.txt": ("refused", "not_a_log"),
        "zeros.bin": ("refused", "zeros"),
        "cut.tlog.gz": ("refused", "unreadable"),
        "odd\udcff.bin": ("refused", "not_a_log"),
    }
