"""Reading of a bundle: nothing in it is trusted before it is checked.

Parts are read by name and never written to the paths that they state; each is size-limited while it is read, whatever
size it claims.
"""

import hashlib
import json
import tempfile
import zipfile
import zlib
from io import SEEK_END
from typing import Any, BinaryIO, Final, NoReturn, Self, TypeVar

import numpy as np
import zstandard
from pydantic import BaseModel, ValidationError

from app.autopilots.registry import EXPERIMENTS
from app.bundles.contents import CONTENTS, MANIFEST, VERSION, Campaign, Contents, Manifest, Record, bring_up_to_date
from app.campaigns.trials.photos import MAX_BYTES as PHOTO_BYTES
from app.campaigns.trials.photos import media_type_of
from app.common.errors import GainlineError, InputError, Problem
from app.db.models import TrajectoryRow
from app.db.trajectories import unpack

MAX_PARTS: Final = 20_000
MAX_DIRECTORY_BYTES: Final = 4 * 2**20
"""Maximum size of the zip's own directory."""
MAX_MANIFEST_BYTES: Final = 4 * 2**20
"""More than MAX_PARTS names with digests need."""
MAX_JSON_BYTES: Final = 64 * 2**20
MAX_VALUES: Final = 2_000_000
"""Maximum number of values in one JSON part: in memory each takes some hundred times the two bytes that it may have in
the file."""
MAX_TOTAL_BYTES: Final = 4 * 2**30
MAX_NUMBERS: Final = 20_000_000
"""Maximum count of numbers in one record: columns times samples."""
_IN_MEMORY_BYTES: Final = 64 * 2**20
_METHODS: Final = frozenset({zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED})
_ENCRYPTED: Final = 0x1
_WIDTH: Final = 4

M = TypeVar("M", bound=BaseModel)


class _Opening:
    """A file for `zipfile` that limits each read to the size of the directory while the zip is being opened."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.seek, self.tell, self.seekable = file.seek, file.tell, file.seekable
        self.is_open = False

    def read(self, size: int = -1) -> bytes:
        if not self.is_open and size > MAX_DIRECTORY_BYTES:
            raise ValueError(f"its directory is larger than {MAX_DIRECTORY_BYTES / 2**20:g} MiB")
        return self._file.read(size)


class Bundle:
    """An opened bundle with its manifest and contents read; `check` checks and unpacks everything else."""

    def __init__(self, file: BinaryIO) -> None:
        """Open a bundle and read its contents. Raises InputError that names what is wrong with it."""
        opening = _Opening(file)
        try:
            self._zip = zipfile.ZipFile(opening)
            opening.is_open = True
        except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError) as error:
            _refuse(
                "file", "is not a zip file" if "not a zip" in str(error) else f"cannot be read as a zip file: {error}"
            )
        self._look_at_directory()
        self.manifest = _parsed(MANIFEST, self._read(MANIFEST, MAX_MANIFEST_BYTES), Manifest)
        listed = self.manifest.parts.keys() | {MANIFEST}
        if odd := sorted(listed ^ set(self._zip.namelist())):
            _refuse(f"{MANIFEST}: parts", f"and the files in the zip differ: {odd[0][:80]!r}")
        contents = self._listed(CONTENTS, MAX_JSON_BYTES)
        self.contents = _parsed(CONTENTS, contents, Contents, version=self.manifest.version)
        # Checked parts, so that the transaction that stores them only reads them. Made last, because a refused bundle
        # must have nothing to close.
        self._unpacked = tempfile.SpooledTemporaryFile(_IN_MEMORY_BYTES, prefix="gainline-bundle-")  # noqa: SIM115
        self._places: dict[str, tuple[int, int]] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._zip.close()
        self._unpacked.close()

    def part(self, name: str, limit: int = 256 * 2**20) -> bytes:
        """Data of a part. Raises InputError when it is missing, too large, or does not match the manifest."""
        if name not in self._places:
            data = self._listed(name, limit)
            self._places[name] = self._unpacked.seek(0, SEEK_END), len(data)
            self._unpacked.write(data)
        start, size = self._places[name]
        self._unpacked.seek(start)
        return self._unpacked.read(size)

    def check(self) -> None:
        """Check every record and photo: checksums, sizes, types. Raises InputError that names the first invalid one."""
        used = {CONTENTS}
        for place, campaign in enumerate(self.contents.campaigns):
            field = f"{CONTENTS}: campaigns.{place}"
            output = _output_of(field, campaign)
            for where, record in campaign.records():
                used.add(_once(used, f"{field}.{where}.part", record.part))
                self._check_record(f"{field}.{where}", record, output)
            for number, trial in enumerate(campaign.trials):
                for photo in trial.photos:
                    used.add(_once(used, f"{field}.trials.{number}.photos", photo.part))
                    if media_type_of(self.part(photo.part, PHOTO_BYTES)) != photo.media_type:
                        _refuse(
                            f"{field}.trials.{number}.photos.media_type", f"differs from the content of {photo.part}"
                        )
                if trial.telemetry is not None:
                    used.add(_once(used, f"{field}.trials.{number}.telemetry", trial.telemetry))
                    self.part(trial.telemetry)
        if idle := sorted(self.manifest.parts.keys() - used):
            _refuse(idle[0], "is not listed in the contents")

    def _listed(self, name: str, limit: int) -> bytes:
        if name not in self.manifest.parts:
            _refuse(name, "is listed in the contents, but is not in the bundle")
        data = self._read(name, limit)
        if hashlib.sha256(data).hexdigest() != self.manifest.parts[name]:
            _refuse(name, "does not have the SHA-256 in the manifest: the file was damaged or changed")
        return data

    def _look_at_directory(self) -> None:
        infos = self._zip.infolist()
        names = [info.filename for info in infos]
        total = sum(info.file_size for info in infos)
        limits = f"would unpack to {total / 2**30:.1f} GiB; at most {MAX_TOTAL_BYTES / 2**30:g} GiB is allowed"
        foreign = "is encrypted, or compressed with an unsupported method"
        for is_wrong, field, reason in (
            (len(infos) > MAX_PARTS, "file", f"has {len(infos)} parts; at most {MAX_PARTS} are allowed"),
            (len(set(names)) < len(names), "file", "has two parts with the same name"),
            (MANIFEST not in names, MANIFEST, "is missing: this zip was not written by Gainline"),
            *(
                (info.flag_bits & _ENCRYPTED or info.compress_type not in _METHODS, info.filename[:80], foreign)
                for info in infos
            ),
            (total > MAX_TOTAL_BYTES, "file", limits),
        ):
            if is_wrong:
                _refuse(field, reason)

    def _read(self, name: str, limit: int) -> bytes:
        """Read a part; never unpacks more than `limit` + 1 bytes, whatever the directory states."""
        try:
            with self._zip.open(name) as stream:
                data = stream.read(limit + 1)
        except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, OSError) as error:
            _refuse(name, f"cannot be unpacked: {error}")
        if len(data) > limit:
            _refuse(name, f"is larger than {limit / 2**20:g} MiB")
        return data

    def _check_record(self, field: str, record: Record, output: str) -> None:
        columns = record.columns
        if columns[0] != "time_s" or len(set(columns)) < len(columns) or output not in columns:
            _refuse(f"{field}.columns", f"must start with time_s and contain {output}, each once")
        size = len(columns) * record.samples
        if size > MAX_NUMBERS:
            _refuse(f"{field}.samples", f"make {size} numbers; at most {MAX_NUMBERS} are allowed")
        data = self.part(record.part)
        try:
            plain = zstandard.get_frame_parameters(data).content_size
        except zstandard.ZstdError as error:
            _refuse(f"{field}.part", f"cannot be unpacked: {error}")
        if plain != _WIDTH * size:  # otherwise the library would allocate the size that the frame states
            _refuse(f"{field}.part", f"would unpack to {plain} bytes, not the {_WIDTH * size} of its samples")
        try:
            trajectory = unpack(trajectory_row(record, data))
        except GainlineError:
            _refuse(f"{field}.checksum", "does not match the samples")
        values = (trajectory.time_s, *trajectory.channels.values())
        if not all(np.isfinite(each).all() for each in values) or (np.diff(trajectory.time_s) <= 0).any():
            _refuse(f"{field}.part", "contains a number that is not finite, or time that does not increase")


def trajectory_row(record: Record, data: bytes) -> TrajectoryRow:
    """The record as a row, with these samples."""
    return TrajectoryRow(data=data, **record.values_without({"part"}))


def _output_of(field: str, campaign: Campaign) -> str:
    """Scored channel of the campaign's experiment. Raises InputError when the gains are not the experiment's."""
    experiment = EXPERIMENTS.get(str(campaign.definition.get("experiment")))
    if experiment is None:
        _refuse(f"{field}.definition.experiment", "is not supported by this version")
    names = set(experiment.space.names)
    for where, given in (
        *((f"trials.{place}", trial.gains) for place, trial in enumerate(campaign.trials)),
        *((f"proposals.{place}", proposal.gains) for place, proposal in enumerate(campaign.proposals)),
    ):
        if set(given) != names:
            _refuse(f"{field}.{where}.gains", f"must be {', '.join(experiment.space.names)}")
    return experiment.output


def _once(used: set[str], field: str, part: str) -> str:
    if part in used:
        _refuse(field, f"{part} is already used for something else")
    return part


def _parsed(name: str, data: bytes, kind: type[M], *, version: int = VERSION) -> M:
    """The part as what it should be, in a bundle of that version."""
    if (values := sum(map(data.count, (b",", b"[", b"{")))) > MAX_VALUES:
        _refuse(
            name, f"contains about {values / 1e6:.0f} million values; at most {MAX_VALUES / 1e6:g} million are allowed"
        )
    try:
        document: Any = json.loads(data, parse_constant=_no_number)
    except (ValueError, RecursionError) as error:
        _refuse(name, f"is not JSON: {error}")
    bring_up_to_date(document, version)
    try:
        return kind.model_validate(document)
    except (ValidationError, RecursionError) as error:
        found = error.errors()[:10] if isinstance(error, ValidationError) else []
        problems = tuple(Problem(f"{name}: {'.'.join(map(str, each['loc']))}", each["msg"]) for each in found)
        raise refusal(*(problems or (Problem(name, "is nested too deeply"),))) from error


def _no_number(text: str) -> NoReturn:
    raise ValueError(f"{text} is not a number")


def _refuse(field: str, reason: str) -> NoReturn:
    raise refusal(Problem(field, reason))


def refusal(
    *problems: Problem,
    hint: str = "Export the bundle again from the installation that has the campaign, and import that file unchanged.",
) -> InputError:
    """Error of a bundle that cannot be imported."""
    return InputError("This bundle cannot be imported; nothing was stored.", problems=problems, hint=hint)
