"""How the inner loops are compiled, and where the machine code is kept."""

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Final, ParamSpec, TypeVar, cast

from numba import config, njit

_P = ParamSpec("_P")
_R = TypeVar("_R")

_HERE: Final = Path(__file__).parent
_NUMBA: Final = vars(config)  # numba fills this module at run time


def _cache_folder() -> Path:
    """A folder of its own for each state of all kernels.

    numba judges a kept kernel by the file it stands in; ours call each other across files, so a change in one would
    leave its callers with the old machine code.
    """
    digest = hashlib.sha256()
    for source in sorted((*_HERE.glob("control/*.py"), *_HERE.glob("plants/*.py"), Path(__file__))):
        digest.update(source.read_bytes())
    own = _HERE / "__pycache__" if os.access(_HERE, os.W_OK) else Path.home() / ".cache" / "gainline"
    return Path(_NUMBA["CACHE_DIR"] or own) / f"kernels-{digest.hexdigest()[:16]}"


def _use_cache() -> bool:
    """Point numba to the folder; False where nothing can be kept, and every process compiles for itself."""
    try:
        folder = _cache_folder()
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError):  # not writable; no home
        return False
    _NUMBA["CACHE_DIR"] = str(folder)
    return os.access(folder, os.W_OK)


_CACHE: Final = _use_cache()


def kernel(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile on first use, keep the machine code, and run without the interpreter's lock.

    The types seen by callers stay those of the Python function. With `NUMBA_DISABLE_JIT=1` it is that very function,
    so kernels must mean the same thing both ways: no reliance on machine integers that wrap by themselves.
    """
    return cast(Callable[_P, _R], njit(nogil=True, cache=_CACHE, error_model="numpy")(function))
