"""A fingerprint of a policy: a hash of its state and of the code that it runs.

The bytes of a plain pickle cannot serve. They refer to imported code only by name, and they differ
between processes: the order of sets follows PYTHONHASHSEED, classes of scripts contain random
identifiers, and equal strings may or may not be shared. This module therefore pickles a policy in
a form that is hashed and never loaded: sets are sorted, values are never shared, and functions and
classes are written out with the globals that they read. Only installed packages, the standard
library and this package are referred to by name and version.
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

_PLAIN = (type(None), bool, int, float, complex, str, bytes)

_VALUES = (*_PLAIN, tuple, frozenset, range, slice, types.CodeType, np.dtype, np.generic)
"""Types whose equal objects are equivalent, whether they are shared or not."""

_STATELESS = (
    *(type(threading.Lock()), type(threading.RLock())),
    *(weakref.ref, weakref.WeakKeyDictionary, weakref.WeakValueDictionary),
)
"""Locks and weak references, on which no action depends."""

_CACHED = type(lru_cache(len))

_SINGLETONS = (type(None), type(NotImplemented), type(...))
"""Classes that pickle refers to by itself."""

_WITHOUT_EFFECT = {
    *("__dict__", "__weakref__", "__doc__", "__module__", "__orig_bases__", "__parameters__"),
    *("__annotations__", "__annotate__", "__annotate_func__", "__annotations_cache__"),
    *("__slotnames__", "__static_attributes__", "__firstlineno__", "_abc_impl"),
}
"""Attributes of classes that do not change what they do, or follow from other attributes."""


class NotIdentifiedError(Exception):
    """A policy cannot be distinguished from others; the message gives the reason."""


def fingerprint_of_copies(packed: Any) -> str:
    """Hash a policy's state and all the code that it runs.

    The hash is the same in every process with the same version of Python.

    Args:
        packed: the pickled policy, whose copies play; or the policy, if it cannot be pickled.

    Raises:
        NotIdentifiedError: the policy cannot be pickled, a part of it cannot be read, or its
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
    """Hash a new copy at once: unpickling another one changes the classes of this one."""
    try:
        return _Fingerprint().of(cloudpickle.loads(packed))
    except Exception as error:  # the policy's parts may raise anything
        raise NotIdentifiedError(f"its state cannot be read ({error!r})") from error


_Pickler: Any = pickle._Pickler  # written in Python, so that its methods can be overridden


class _Fingerprint(_Pickler):
    """Hashes objects as it pickles them.

    Functions, classes and modules refer to each other in cycles and long chains. They get numbers
    where they occur, and are written out one after another at the end.
    """

    dispatch_table = cloudpickle.Pickler.dispatch_table

    def __init__(self, outer: _Fingerprint | None = None) -> None:
        self._hash = hashlib.sha256()
        super().__init__(types.SimpleNamespace(write=self._hash.update), 4)
        self._numbers: dict[int, int] = {}
        self._queue: list[Any] = []
        if outer is not None:
            self.memo: Any = dict(outer.memo)
            self._numbers = dict(outer._numbers)

    def of(self, obj: object) -> str:
        """Hash an object and everything that it refers to."""
        self.dump(obj)
        for each in self._queue:  # grows in the loop
            self.dump(self._parts(each))
        return self._hash.hexdigest()

    def memoize(self, obj: Any) -> None:
        if not isinstance(obj, _VALUES):
            super().memoize(obj)

    def save_global(self, obj: Any, name: str | None = None) -> None:
        """Write a name, and the hash of the code in which it is defined."""
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
        if isinstance(obj, types.FunctionType) or (
            isinstance(obj, type) and obj not in _SINGLETONS
        ):
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
        if kind not in self.dispatch_table and _has_own_pickling(kind):
            return self._reduced_and_whole(obj)
        return NotImplemented

    def _number(self, obj: Any) -> tuple[Any, ...]:
        """Refer to a function, a class or a module by a number; its content is written later."""
        if id(obj) not in self._numbers:
            self._numbers[id(obj)] = len(self._numbers)
            self._queue.append(obj)
        return int, (self._numbers[id(obj)],)

    def _sorted(self, elements: Iterable[Any]) -> list[str]:
        """Represent a set's elements in an order that does not depend on their hashes."""
        return sorted(
            repr(each) if _is_plain(each) else _Fingerprint(self).of(each) for each in elements
        )

    def _reduced_and_whole(self, obj: Any) -> Any:
        """Write an object as it pickles itself, and its attributes, which it may leave out."""
        reduced = obj.__reduce_ex__(4)
        if isinstance(reduced, str):
            return reduced
        function, arguments, *rest = reduced
        state, items, pairs = [*rest, None, None, None][:3]
        whole = state, list(items or ()), list(pairs or ()), getattr(obj, "__dict__", None)
        return function, arguments, whole

    def _parts(self, obj: Any) -> tuple[Any, ...]:
        """Everything that determines what a function, a class or a module does."""
        if isinstance(obj, types.FunctionType):
            return (
                *(obj.__qualname__, obj.__code__, obj.__defaults__, obj.__kwdefaults__),
                *(obj.__closure__, obj.__dict__, list(_globals_of(obj))),
            )
        if isinstance(obj, type):
            own = {name: obj.__dict__[name] for name in sorted({*vars(obj)} - _WITHOUT_EFFECT)}
            return obj.__qualname__, type(obj), obj.__bases__, own
        held = {
            name: value
            for name, value in sorted(vars(obj).items())
            if not (name.startswith("__") or isinstance(value, types.ModuleType))
        }
        return obj.__name__, _code_of(obj), held


def _is_plain(obj: Any) -> bool:
    """Whether the `repr` determines the object."""
    if type(obj) is tuple:
        return all(map(_is_plain, obj))
    return type(obj) in _PLAIN or isinstance(obj, (np.number, np.bool_))


def _parts_of_code(code: types.CodeType) -> tuple[Any, ...]:
    """What code does, without its file and line numbers."""
    return (
        *(code.co_code, code.co_consts, code.co_names, code.co_varnames, code.co_freevars),
        *(code.co_cellvars, code.co_flags, code.co_argcount, code.co_posonlyargcount),
        *(code.co_kwonlyargcount, code.co_name, getattr(code, "co_exceptiontable", b"")),
    )


def _globals_of(function: types.FunctionType) -> Iterator[tuple[str, Any]]:
    """The globals and modules that a function and its inner functions read."""
    codes = [function.__code__]
    for code in codes:  # grows in the loop
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
    except (Exception, SystemExit):  # the function may never import it
        return name


def _read(value: Any, names: set[str], seen: set[types.ModuleType]) -> Any:
    """A global's value; of a module, the attributes that the code may read."""
    if not isinstance(value, types.ModuleType) or _is_library_module(value.__name__):
        return value
    if value in seen:
        return value.__name__
    seen.add(value)
    held = vars(value)
    read = [(name, _read(held[name], names, seen)) for name in sorted(names & {*held})]
    return value.__name__, _code_of(value), read


def _has_own_pickling(kind: type) -> bool:
    """Whether a class outside of installed packages defines how its objects are pickled."""
    for name in ("__reduce_ex__", "__reduce__", "__getstate__"):
        owner = next((each for each in kind.__mro__ if name in vars(each)), object)
        if owner is not object and not _is_library(owner):
            return True
    return False


# Where code comes from.


def _is_library(obj: Any) -> bool:
    """Whether a function or a class can be found by its name in an installed module."""
    name = getattr(obj, "__module__", None)
    if not isinstance(name, str) or not _is_library_module(name):
        return False
    found: Any = sys.modules.get(name)
    for part in obj.__qualname__.split("."):
        found = getattr(found, part, None)
    return found is obj


def _is_library_module(name: str) -> bool:
    """Whether a module belongs to the standard library, to this package or to an installed one."""
    top = name.partition(".")[0]
    if top in _PACKAGES:
        return True
    module = sys.modules.get(name)
    spec = getattr(module, "__spec__", None) if module else importlib.util.find_spec(name)
    file = getattr(module, "__file__", None) or getattr(spec, "origin", None)
    if file is None or file in ("built-in", "frozen"):
        return file is not None
    path = Path(file).resolve()
    if {"site-packages", "dist-packages"} & {*path.parts}:
        return top in _distributions()
    return any(path.is_relative_to(each) for each in _standard())


def _code_of(module: types.ModuleType) -> str:
    """A hash of a module's file, or of the installed package that it belongs to."""
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
    """The hashes of the versions and files of the distributions of each installed package.

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
