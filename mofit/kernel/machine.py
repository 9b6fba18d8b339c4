"""The host as a target of LLVM: code in, callable addresses out."""

from __future__ import annotations

import ctypes
import ctypes.util
import itertools
import threading
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path

import llvmlite
import llvmlite.binding as llvm

from mofit.kernel import cache as cache_files

_serial = itertools.count()
_lock = threading.RLock()


@dataclass(frozen=True)
class Host:
    """What LLVM needs to know about this machine.

    ``width`` is the number of doubles in a register, ``name`` tells processor and features.
    """

    machine: llvm.TargetMachine
    jit: llvm.LLJIT
    width: int
    fma: bool
    name: str


@cache
def host() -> Host:
    """The machine at hand, with its widest vector registers in use."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    features = llvm.get_host_cpu_features()
    features["prefer-256-bit"] = False
    x86 = llvm.get_process_triple().startswith(("x86", "i686"))
    if not x86:
        del features["prefer-256-bit"]
    width = 8 if features.get("avx512f") else 4 if features.get("avx") else 2
    target = llvm.Target.from_triple(llvm.get_process_triple())

    name = f"{llvm.get_process_triple()} {llvm.get_host_cpu_name()} {features.flatten()}"

    def machine() -> llvm.TargetMachine:
        return target.create_target_machine(
            cpu=llvm.get_host_cpu_name(), features=features.flatten(), opt=2, reloc="pic", codemodel="small", jit=True
        )

    jit = llvm.create_lljit_compiler(machine(), use_jit_link=False)
    return Host(machine(), jit, width, bool(features.get("fma")) if x86 else True, name)


@cache
def libm_address(name: str) -> int:
    """Address of a function of the C mathematics library."""
    library = ctypes.CDLL(ctypes.util.find_library("m") or None)
    return int(ctypes.cast(getattr(library, name), ctypes.c_void_p).value or 0)


@dataclass(frozen=True)
class Code:
    """Machine code in memory; it lives as long as this object."""

    tracker: llvm.ResourceTracker
    entry: ctypes._CFuncPtr  # type: ignore[name-defined]


def compile_entry(what: object, text: Callable[[], str], libm: Iterable[str], signature: type) -> Code:
    """Compile LLVM IR whose entry function is ``run``, or take what is kept of it.

    Parameters
    ----------
    what
        All that decides the text, apart from this package itself and the processor; known by its ``repr``.
    text
        Writes the module, if it is needed.
    libm
        Functions of the C mathematics library that it may call, declared as ``libm_<name>``.
    signature
        The ctypes type of ``run``.
    """
    with _lock:
        target = host()
        library = llvm.JITLibraryBuilder().add_object_img(_object(what, text, target)).export_symbol("run")
        for name in libm:
            library.import_symbol(f"libm_{name}", libm_address(name))
        tracker = library.link(target.jit, f"mofit_{next(_serial)}")
        return Code(tracker, signature(tracker["run"]))


@cache
def _package() -> str:
    """Hash of the code that writes modules."""
    return sha256(b"".join(path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.py")))).hexdigest()


def _object(what: object, text: Callable[[], str], target: Host) -> bytes:
    """Machine code of a module, from the cache where it is kept."""
    versions = (_package(), target.name, llvm.llvm_version_info, llvmlite.__version__)
    key = sha256(repr((what, *versions)).encode()).hexdigest()
    code = cache_files.load(key)
    if code is None:
        module = llvm.parse_assembly(text())
        options = llvm.create_pipeline_tuning_options(speed_level=2)
        options.loop_vectorization = options.slp_vectorization = options.loop_unrolling = False
        builder = llvm.create_pass_builder(target.machine, options)
        builder.getModulePassManager().run(module, builder)
        code = target.machine.emit_object(module)
        cache_files.keep(key, code)
    return code
