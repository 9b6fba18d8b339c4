"""The host as a target of LLVM: code in, callable addresses out, and compiled code kept on disk.

A file is named by the hash of everything that decides its content (graph, this package, processor, LLVM) and begins
with the hash of the code in it: a damaged file is ignored and written anew. Files are replaced atomically. Without a
folder that can be written to, nothing is kept. Programs are kept there, too (`kept`).

Code can be made quickly, or well, so that it runs faster. Its numbers are the same.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import itertools
import os
import tempfile
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path

import llvmlite
import llvmlite.binding as llvm
from casadi import CasadiMeta

#: Names the folder instead of the user's cache folder; empty: nothing is kept.
CACHE_VARIABLE = "MOFIT_KERNEL_CACHE"
#: Beyond this number files go; one model takes about ten of 10 kB each, a diagnosis some hundreds.
MOST_FILES = 5000
#: Then room is made for one in so many.
_SPARE = 10
#: Functions of the C mathematics library that code may call, with the number of their arguments.
LIBM = dict.fromkeys(
    "acos acosh asin asinh atan atanh cos cosh erf exp expm1 log log1p sin sinh tan tanh".split(), 1
) | dict.fromkeys("atan2 fmod hypot pow remainder".split(), 2)
_DIGEST = sha256().digest_size
_serial = itertools.count()
#: When this run began, s: what was kept before, another one has needed.
_BEGAN = time.time()
_lock = threading.RLock()


@dataclass(frozen=True)
class Host:
    """The local machine for LLVM: ``width`` doubles in a register; ``name`` identifies processor and features.

    ``machine`` makes code well, and ``quick`` quickly.

    ``libmvec`` are addresses of the C mathematics library's functions of whole registers, by the scalar ones' names;
    empty where it has none (glibc has them on x86).
    """

    machine: llvm.TargetMachine
    quick: llvm.TargetMachine
    jit: llvm.LLJIT
    width: int
    fma: bool
    name: str
    libmvec: Mapping[str, int]


@cache
def host() -> Host:
    """The local machine, its widest vector registers in use."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    triple, cpu, features = llvm.get_process_triple(), llvm.get_host_cpu_name(), llvm.get_host_cpu_features()
    features["prefer-256-bit"] = False
    x86 = triple.startswith(("x86", "i686"))
    if not x86:
        del features["prefer-256-bit"]
    width = 8 if features.get("avx512f") else 4 if features.get("avx") else 2
    target = llvm.Target.from_triple(triple)

    def machine(opt: int = 2) -> llvm.TargetMachine:
        return target.create_target_machine(
            cpu=cpu, features=features.flatten(), opt=opt, reloc="pic", codemodel="small", jit=True
        )

    jit = llvm.create_lljit_compiler(machine(), use_jit_link=False)
    isa = {8: "e", 4: "d" if features.get("avx2") else "c", 2: "b"}[width]
    libmvec = _libmvec(f"_ZGV{isa}N{width}") if x86 else {}
    name = f"{triple} {cpu} {features.flatten()} {' '.join(libmvec)}"
    return Host(machine(), machine(opt=0), jit, width, bool(features.get("fma")) if x86 else True, name, libmvec)


def _libmvec(prefix: str) -> dict[str, int]:
    """Addresses of the vector functions that there are; their names say the registers and the number of arguments."""
    try:
        library = ctypes.CDLL("libmvec.so.1")
    except OSError:
        return {}
    found = {name: getattr(library, f"{prefix}{'v' * count}_{name}", None) for name, count in LIBM.items()}
    return {name: _address(function) for name, function in found.items() if function is not None}


@cache
def libm_address(name: str) -> int:
    """Address of a function of the C mathematics library."""
    return _address(getattr(_libm(), name))


@cache
def _libm() -> ctypes.CDLL:
    return ctypes.CDLL(ctypes.util.find_library("m") or None)  # to look for it takes some milliseconds


def _address(function: ctypes._CFuncPtr) -> int:  # type: ignore[name-defined]
    return int(ctypes.cast(function, ctypes.c_void_p).value or 0)


@dataclass(frozen=True)
class Code:
    """Machine code in memory; it lives as long as this object."""

    tracker: llvm.ResourceTracker
    entry: ctypes._CFuncPtr  # type: ignore[name-defined]


def compile_entry(what: object, text: Callable[[], str], signature: type, *, quick: bool = False) -> Code:
    """Compile LLVM IR whose entry function is ``run``, or load its code from the cache.

    Parameters
    ----------
    what
        All that decides the text, apart from this package and the processor; known by its ``repr``.
    text
        Writes the module, if needed. It may call the functions of `LIBM` as ``libm_<name>``, and those of the host's
        ``libmvec`` as ``libmvec_<name>``.
    signature
        The ctypes type of ``run``.
    quick
        Make the code quickly: most will not be needed again. What an earlier run has needed, too, is made well.
    """
    with _lock:
        target = host()
        library = llvm.JITLibraryBuilder().add_object_img(_object(what, text, target, quick)).export_symbol("run")
        for name in LIBM:
            library.import_symbol(f"libm_{name}", libm_address(name))
        for name, address in target.libmvec.items():
            library.import_symbol(f"libmvec_{name}", address)
        tracker = library.link(target.jit, f"mofit_{next(_serial)}")
        return Code(tracker, signature(tracker["run"]))


@cache
def _package() -> str:
    """Hash of the code that writes modules."""
    return sha256(b"".join(path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.py")))).hexdigest()


def _object(what: object, text: Callable[[], str], target: Host, quick: bool) -> bytes:
    """Machine code of a module, from the cache where it is kept."""
    well = (what, target.name, llvm.llvm_version_info, llvmlite.__version__)
    hasty = (*well, "quick")

    def compiled(machine: llvm.TargetMachine) -> bytes:
        # what passes over the text would simplify is simple already: they take time and gain nothing
        return machine.emit_object(llvm.parse_assembly(text()))

    before = _kept_at(hasty)
    new = before is None or before >= _BEGAN
    if quick and new and _kept_at(well) is None:
        return kept(hasty, lambda: compiled(target.quick))
    return kept(well, lambda: compiled(target.machine))


def kept(what: object, make: Callable[[], bytes]) -> bytes:
    """Bytes from the cache, or made and kept there.

    ``what`` is all that decides them apart from this package and CasADi, whose numbers of operations they hold.
    """
    key = _key(what)
    found = load_code(key)
    if found is None:
        found = make()
        keep_code(key, found)
    return found


def _key(what: object) -> str:
    return sha256(repr((what, _package(), CasadiMeta.version())).encode()).hexdigest()


def _kept_at(what: object) -> float | None:
    """When it was kept, s; None if it is not."""
    folder = cache_folder()
    if folder is not None:
        with suppress(OSError):
            return (folder / _key(what)).stat().st_mtime
    return None


def cache_folder() -> Path | None:
    """Where code is kept: ``$MOFIT_KERNEL_CACHE``, else ``mofit/kernel`` in the user's cache folder."""
    named = os.environ.get(CACHE_VARIABLE)
    if named is not None:
        return Path(named) if named else None
    with suppress(RuntimeError):
        return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "mofit" / "kernel"
    return None


def load_code(key: str) -> bytes | None:
    """Code kept under a key; None if there is none or it is damaged."""
    folder = cache_folder()
    if folder is None:
        return None
    file = folder / key
    try:
        content = file.read_bytes()
    except OSError:
        return None
    with suppress(OSError):  # used now: others go first
        os.utime(file, ns=(time.time_ns(), file.stat().st_mtime_ns))
    code = content[_DIGEST:]
    return code if sha256(code).digest() == content[:_DIGEST] else None


def keep_code(key: str, code: bytes, most_files: int = MOST_FILES) -> None:
    """Keep code under a key, if the disk allows.

    Of more files than ``most_files`` those go that were not used for longest; some more than needed, as looking for
    them takes as long as to compile one.
    """
    folder = cache_folder()
    if folder is None:
        return
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=folder, prefix=".")
        with os.fdopen(handle, "wb") as file:
            file.write(sha256(code).digest() + code)
        os.replace(temporary, folder / key)
        with os.scandir(folder) as entries:  # there are thousands
            files = [one for one in entries if not one.name.startswith(".")]
        if len(files) > most_files:
            files.sort(key=lambda one: one.stat().st_atime_ns)
            for one in files[: len(files) - most_files + most_files // _SPARE]:
                Path(one).unlink(missing_ok=True)
