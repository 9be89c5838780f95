"""What tells one policy from another: a hash of its state and of the code that it runs.

A plain pickle does not serve. It refers to imported code by name alone, and its bytes differ
from process to process: the order of sets follows PYTHONHASHSEED, classes defined in scripts
carry random numbers, and equal strings count as shared or not by accident. So a policy is
pickled here in a form that is never loaded: sets are sorted, values are never shared, and
functions and classes are written out, with the globals they read, wherever they come from.
Only installed packages, the standard library and this package are referred to by name.
"""

from __future__ import annotations

import dis
import hashlib
import importlib
import importlib.util
import pickle
import re
import sys
import sysconfig
import threading
import types
import weakref
from collections.abc import Iterable, Iterator
from functools import cache, lru_cache
from importlib import metadata
from pathlib import Path
from typing import Any

import cloudpickle
import numpy as np

__all__ = ["NotIdentifiedError", "fingerprint_of_copies"]

_PACKAGES = ("DroneSwarmSearch", "DroneSwarmSearchEnvironment")
"""Their code is part of every key of the store."""

_INSTALLED = {"site-packages", "dist-packages"}

_PLAIN = (type(None), bool, int, float, complex, str, bytes)

_VALUES = (*_PLAIN, tuple, frozenset, range, slice, types.CodeType, np.dtype, np.generic)
"""Types of which equal objects are alike, whether they are one object or several."""

_STATELESS = (
    *(type(threading.Lock()), type(threading.RLock())),
    *(weakref.ref, weakref.WeakKeyDictionary, weakref.WeakValueDictionary),
)
"""Locks, and what refers to objects that are held elsewhere: no action follows from them."""

_CACHED = type(lru_cache(len))

_NOT_BEHAVIOUR = {
    *("__dict__", "__weakref__", "__doc__", "__module__", "__orig_bases__", "__parameters__"),
    *("__annotations__", "__annotate__", "__annotate_func__", "__annotations_cache__"),
    *("__slotnames__", "__static_attributes__", "__firstlineno__", "_abc_impl"),
}
"""Attributes of classes that change nothing of what they do, or follow from others."""


class NotIdentifiedError(Exception):
    """Nothing tells this policy from others; the message says why."""


def fingerprint_of_copies(packed: Any) -> str:
    """A hash of a policy's state and of all the code that it runs.

    It is the same in every process with the same version of Python.

    Args:
        packed: the policy, pickled; copies of it are what plays. Or itself, if it cannot be.

    Raises:
        NotIdentifiedError: it could not be pickled, a part of it cannot be read, or its
            copies differ.
    """
    if not isinstance(packed, bytes):
        try:
            cloudpickle.dumps(packed)
        except Exception as error:
            raise NotIdentifiedError(f"it cannot be pickled ({error!r})") from error
    first, second = (_fingerprint_of_copy(packed) for _ in range(2))
    if first != second:
        raise NotIdentifiedError("its copies differ")
    return first


def _fingerprint_of_copy(packed: bytes) -> str:
    """A copy's fingerprint, taken at once: unpickling another changes the classes of this one."""
    try:
        return _Fingerprint().of(cloudpickle.loads(packed))
    except Exception as error:  # whatever its parts raise
        raise NotIdentifiedError(f"its state cannot be read ({error!r})") from error


_Pickler: Any = pickle._Pickler  # the one in Python: its methods can be replaced


class _Fingerprint(_Pickler):
    """Hashes objects as it pickles them; what it writes cannot be loaded.

    Functions, classes and modules get numbers where they occur, and are written out one after
    another at the end: they refer to each other in circles, and in chains of any length.
    """

    dispatch_table = cloudpickle.Pickler.dispatch_table

    def __init__(self, outer: _Fingerprint | None = None) -> None:
        self._hash = hashlib.sha256()
        super().__init__(_Sink(self._hash), 4)
        self._numbers: dict[int, int] = {}
        self._queue: list[Any] = []
        if outer is not None:
            self.memo: Any = dict(outer.memo)
            self._numbers = dict(outer._numbers)

    def of(self, obj: object) -> str:
        """The hash of an object and of all that it refers to."""
        self.dump(obj)
        for each in self._queue:  # which grows
            self.dump(self._parts(each))
        return self._hash.hexdigest()

    def memoize(self, obj: Any) -> None:
        if not isinstance(obj, _VALUES):
            super().memoize(obj)

    def save_global(self, obj: Any, name: str | None = None) -> None:
        """Refer to something by name; to code that may change by its file, too."""
        super().save_global(obj, name)
        module = sys.modules.get(str(getattr(obj, "__module__", None)))
        if module is not None:
            self.save(_code_of(module))

    def reducer_override(self, obj: Any) -> Any:
        kind = type(obj)
        if kind in _PLAIN or kind in (tuple, list, dict):
            return NotImplemented
        if isinstance(obj, (set, frozenset)):
            return kind, (self._sorted(obj),), getattr(obj, "__dict__", None)
        if isinstance(obj, types.FunctionType) or (isinstance(obj, type) and obj not in _SINGLE):
            return NotImplemented if _is_library(obj) else self._number(obj)
        if isinstance(obj, types.ModuleType):
            if _is_library_module(obj.__name__):
                return importlib.import_module, (obj.__name__, _code_of(obj))
            return self._number(obj)
        if isinstance(obj, types.CodeType):
            return types.CodeType, _parts_of_code(obj)
        if isinstance(obj, _CACHED):
            return lru_cache, (obj.__wrapped__, sorted(obj.cache_parameters().items()))
        if isinstance(obj, _STATELESS):
            return str, (kind.__qualname__,)
        if isinstance(obj, types.ClassMethodDescriptorType):
            return kind, (obj.__objclass__, obj.__name__)
        torch = sys.modules.get("torch")
        if torch is not None and isinstance(obj, torch.Tensor):
            values = obj.detach().cpu().contiguous().reshape(-1).view(torch.uint8)
            return kind, (str(obj.dtype), tuple(obj.shape), values.numpy().tobytes())
        if kind not in self.dispatch_table and _pickles_itself(kind):
            return self._reduced_and_whole(obj)
        return NotImplemented

    def _number(self, obj: Any) -> tuple[Any, ...]:
        """Stands for a function, a class or a module that is written out later."""
        if id(obj) not in self._numbers:
            self._numbers[id(obj)] = len(self._numbers)
            self._queue.append(obj)
        return int, (self._numbers[id(obj)],)

    def _sorted(self, elements: Iterable[Any]) -> list[str]:
        """What stands for a set's elements, in an order that does not follow from hashes."""
        return sorted(
            repr(each) if _is_plain(each) else _Fingerprint(self).of(each) for each in elements
        )

    def _reduced_and_whole(self, obj: Any) -> Any:
        """An object with a pickling of its own, which may leave out what it reads elsewhere."""
        reduced = obj.__reduce_ex__(4)
        if isinstance(reduced, str):
            return reduced
        function, arguments, *rest = reduced
        state, items, pairs = [*rest, None, None, None][:3]
        whole = state, list(items or ()), list(pairs or ()), getattr(obj, "__dict__", None)
        return function, arguments, whole

    def _parts(self, obj: Any) -> tuple[Any, ...]:
        """All that a function, a class or a module does follows from."""
        if isinstance(obj, types.FunctionType):
            return (
                *(obj.__qualname__, obj.__code__, obj.__defaults__, obj.__kwdefaults__),
                *(obj.__closure__, obj.__dict__, list(_globals_of(obj))),
            )
        if isinstance(obj, type):
            own = {name: obj.__dict__[name] for name in sorted({*vars(obj)} - _NOT_BEHAVIOUR)}
            return obj.__qualname__, type(obj), obj.__bases__, own
        held = {
            name: value
            for name, value in sorted(vars(obj).items())
            if not (name.startswith("__") or isinstance(value, types.ModuleType))
        }
        return obj.__name__, _code_of(obj), held


class _Sink:
    """Takes what is written into a hash."""

    def __init__(self, digest: Any) -> None:
        self.write = digest.update


_SINGLE = (type(None), type(NotImplemented), type(...))
"""Classes that pickle knows how to name."""


def _is_plain(obj: Any) -> bool:
    """Whether the `repr` says all."""
    if type(obj) is tuple:
        return all(map(_is_plain, obj))
    return type(obj) in _PLAIN or isinstance(obj, (np.number, np.bool_))


def _parts_of_code(code: types.CodeType) -> tuple[Any, ...]:
    """What code does; neither where it is, nor the numbers of its lines."""
    return (
        *(code.co_code, code.co_consts, code.co_names, code.co_varnames, code.co_freevars),
        *(code.co_cellvars, code.co_flags, code.co_argcount, code.co_posonlyargcount),
        *(code.co_kwonlyargcount, code.co_name, getattr(code, "co_exceptiontable", b"")),
    )


def _globals_of(function: types.FunctionType) -> Iterator[tuple[str, Any]]:
    """The globals and modules that a function reads, those of functions inside it included."""
    codes = [function.__code__]
    for code in codes:  # which grows
        codes += [each for each in code.co_consts if isinstance(each, types.CodeType)]
    names = {name for code in codes for name in code.co_names}
    names |= {each for code in codes for each in code.co_consts if isinstance(each, str)}
    known = function.__globals__
    for code in codes:
        level = 0
        for step in dis.get_instructions(code):
            if "GLOBAL" in step.opname or step.opname == "LOAD_NAME":
                if step.argval in known:
                    yield step.argval, _read(known[step.argval], names, set())
            elif step.opname == "IMPORT_NAME":
                name = "." * level + step.argval
                yield name, _read(_imported(name, known.get("__package__")), names, set())
            elif isinstance(step.argval, int):
                level = step.argval  # the last integer before an import is its level
    if names & {"import_module", "__import__"}:
        for name in sorted(text for text in names if re.fullmatch(r"[\w.]+", text)):
            yield name, _read(_imported(name, None), names, set())


def _imported(name: str, package: str | None) -> Any:
    """A module that a function imports when it is called; its name if it is installed."""
    try:
        name = importlib.util.resolve_name(name, package)
        return name if _is_library_module(name) else importlib.import_module(name)
    except (Exception, SystemExit):  # the function may never get there, or be ready for it
        return name


def _read(value: Any, names: set[str], seen: set[types.ModuleType]) -> Any:
    """A global's value; of a module, those of its attributes that the code may ask for."""
    if not isinstance(value, types.ModuleType) or _is_library_module(value.__name__):
        return value
    if value in seen:
        return value.__name__
    seen.add(value)
    held = vars(value)
    read = [(name, _read(held[name], names, seen)) for name in sorted(names & {*held})]
    return value.__name__, _code_of(value), read


def _pickles_itself(kind: type) -> bool:
    """Whether a class that is not installed says how its objects are pickled."""
    for name in ("__reduce_ex__", "__reduce__", "__getstate__"):
        owner = next((each for each in kind.__mro__ if name in vars(each)), object)
        if owner is not object and not _is_library(owner):
            return True
    return False


# Where code comes from.


def _is_library(obj: Any) -> bool:
    """Whether a function or a class is found by its name in an installed module."""
    name = getattr(obj, "__module__", None)
    if not isinstance(name, str) or not _is_library_module(name):
        return False
    found: Any = sys.modules.get(name)
    for part in obj.__qualname__.split("."):
        found = getattr(found, part, None)
    return found is obj


def _is_library_module(name: str) -> bool:
    """Whether a module is of the standard library, of this package, or installed."""
    top = name.partition(".")[0]
    if top in _PACKAGES:
        return True
    module = sys.modules.get(name)
    spec = getattr(module, "__spec__", None) if module else importlib.util.find_spec(name)
    file = getattr(module, "__file__", None) or getattr(spec, "origin", None)
    if file is None or file in ("built-in", "frozen"):
        return file is not None
    path = Path(file).resolve()
    if _INSTALLED & {*path.parts}:
        return top in _distributions()
    return any(path.is_relative_to(each) for each in _standard())


def _code_of(module: types.ModuleType) -> str:
    """A hash that changes with a module's code: of its package's files, or of its own."""
    name, file = module.__name__, getattr(module, "__file__", None)
    if _is_library_module(name):
        return " ".join(sorted(_distributions().get(name.partition(".")[0], ())))
    if file is None or name == "__main__" or not Path(file).is_file():
        return ""
    return hashlib.sha256(Path(file).read_bytes()).hexdigest()


@cache
def _standard() -> tuple[Path, ...]:
    return tuple(Path(sysconfig.get_path(name)).resolve() for name in ("stdlib", "platstdlib"))


@cache
def _distributions() -> dict[str, list[str]]:
    """What brings each installed package: a hash of its files' names and hashes, and versions.

    `importlib.metadata.packages_distributions` misses many of them in Python 3.10.
    """
    found: dict[str, list[str]] = {}
    for each in metadata.distributions():
        record = each.read_text("RECORD") or ""
        names = {re.split("[/.,]", line, maxsplit=1)[0] for line in record.splitlines()}
        names |= {*(each.read_text("top_level.txt") or "").split()}
        text = f"{each.metadata['Name']} {each.version}\n{record}"
        digest = hashlib.sha256(text.encode()).hexdigest()
        for name in names:
            found.setdefault(name, []).append(digest)
    return found
