"""How the inner loops are compiled, and where the machine code is kept.

numba is imported when the first kernel is called: a process that computes nothing, such as the one that answers
browsers, never loads it.
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
    """A folder of its own for each state of all kernels, below the one that is `chosen`, if any.

    numba judges a kept kernel by the file it stands in; ours call each other across files, so a change in one would
    leave its callers with the old machine code.
    """
    digest = hashlib.sha256()
    for source in sorted((*_HERE.glob("control/*.py"), *_HERE.glob("plants/*.py"), Path(__file__))):
        digest.update(source.read_bytes())
    own = _HERE / "__pycache__" if os.access(_HERE, os.W_OK) else Path.home() / ".cache" / "gainline"
    return Path(chosen or own) / f"kernels-{digest.hexdigest()[:16]}"


@cache
def _use_cache() -> bool:
    """Point numba to the folder; False where nothing can be kept, and every process compiles for itself."""
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
    """A function that is compiled when it is first called, from Python or by another kernel as that is compiled."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        update_wrapper(self, function)

    @cached_property
    def _compiled(self) -> Callable[..., Any]:
        from numba import njit

        compiled: Callable[..., Any] = njit(nogil=True, cache=_use_cache(), error_model="numpy")(self._function)
        type(self).__call__ = staticmethod(compiled)  # type: ignore[method-assign]
        return compiled

    @property
    def _numba_type_(self) -> object:
        """What numba takes it for where another kernel calls it (numba's own attribute)."""
        from numba import types

        dispatcher: Any = self._compiled
        return types.Dispatcher(dispatcher)

    def __call__(self, *args: object, **kwargs: object) -> object:
        """The first call; the compiled function then takes this method's place, which leaves nothing between."""
        return self._compiled(*args, **kwargs)


def kernel(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile on first use, keep the machine code, and run without the interpreter's lock.

    The types seen by callers stay those of the Python function. With `NUMBA_DISABLE_JIT=1` it is that very function
    that runs, so kernels must mean the same thing both ways: no reliance on machine integers that wrap by themselves.
    """
    own_type = type(function.__name__, (_Kernel,), {})  # whose `__call__` is replaced for this kernel alone
    compiled_later: Callable[_P, _R] = own_type(function)
    return compiled_later
