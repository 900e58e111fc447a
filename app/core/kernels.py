"""Compilation of the inner loops, and the cache of their machine code.

numba is imported when the first kernel is called, so a process that computes nothing, such as the web server, never
loads it.
"""

import hashlib
import os
from collections.abc import Callable
from functools import cache, cached_property, update_wrapper
from pathlib import Path
from typing import Any, Final, ParamSpec, TypeVar

_P = ParamSpec("_P")
_R = TypeVar("_R")

_HERE: Final = Path(__file__).parent


def _cache_folder(chosen: str) -> Path:
    """A separate folder for each version of the kernels' source, below `chosen` if given.

    numba invalidates a cached kernel only when its own file changes. Our kernels call each other across files, so a
    change in one file would leave its callers with stale machine code.
    """
    digest = hashlib.sha256()
    replicas = _HERE.parent.glob("autopilots/*/replica/*.py")
    for source in sorted((*_HERE.glob("control/*.py"), *_HERE.glob("models/*.py"), *replicas, Path(__file__))):
        digest.update(source.read_bytes())
    own = _HERE / "__pycache__" if os.access(_HERE, os.W_OK) else Path.home() / ".cache" / "gainline"
    return Path(chosen or own) / f"kernels-{digest.hexdigest()[:16]}"


@cache
def _use_cache() -> bool:
    """Point numba to the folder; False if it is not writable, and every process then compiles for itself."""
    from numba import config

    settings = vars(config)  # numba fills this module at run time
    try:
        folder = _cache_folder(settings["CACHE_DIR"])
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError):  # not writable; no home
        return False
    settings["CACHE_DIR"] = str(folder)
    return os.access(folder, os.W_OK)


class _Kernel:
    """A function that is compiled on its first call, from Python or when another kernel that calls it is compiled."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        update_wrapper(self, function)

    @cached_property
    def _compiled(self) -> Callable[..., Any]:
        from numba import njit

        compiled: Callable[..., Any] = njit(nogil=True, cache=_use_cache(), error_model="numpy")(self._function)
        return compiled

    @property
    def _numba_type_(self) -> object:
        """The type numba sees where another kernel calls this one (an attribute defined by numba)."""
        from numba import types

        dispatcher: Any = self._compiled
        return types.Dispatcher(dispatcher)

    def __call__(self, *args: object, **kwargs: object) -> Any:
        return self._compiled(*args, **kwargs)


def kernel(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile on first use, cache the machine code, and run without the interpreter's lock.

    Callers see the types of the Python function. With `NUMBA_DISABLE_JIT=1` the Python function itself runs, so kernels
    must behave the same both ways: they must not rely on machine integers wrapping around.
    """
    return _Kernel(function)
