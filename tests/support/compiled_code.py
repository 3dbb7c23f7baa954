"""What compiled functions call outside themselves."""

from __future__ import annotations

import re
from typing import Any

LIBM = r"sin|cos|sincos|tan|tanh|exp|exp2|expm1|log|log2|log1p|pow|powi|ldexp|frexp|fma|fmuladd|floor|rint|sqrt"


def library_calls(function: Any) -> set[str]:
    """Mathematical routines that the compiled code names: LLVM intrinsics, libm or a vector maths library."""
    llvm, assembly = (next(iter(d.values())) for d in (function.inspect_llvm(), function.inspect_asm()))
    called = re.findall(rf'call [^@\n]*@"?((?:llvm\.)?(?:{LIBM})(?:\.\w+)?)"?\(', llvm)
    fused = re.findall(r"\b(?:vfn?m(?:add|sub)\w+|fn?m(?:add|sub|la|ls))\b", assembly)
    return {*called, *fused, *re.findall(rf"\b(?:{LIBM}|__svml_\w+)\b", assembly)}
