"""Calls of a function compiled by ffcx, point after point, from numba."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic


@intrinsic
def _call(typingctx, address, out, coefficients, constants, places):
    """Call void(double *A, double *w, double *c, double *x, int *, uint8_t *, void *) at an address; arguments are addresses too."""
    signature = types.void(types.intp, types.intp, types.intp, types.intp, types.intp)

    def generate(context, builder, sig, args):
        pointer = ir.IntType(8).as_pointer()
        function = builder.inttoptr(args[0], ir.FunctionType(ir.VoidType(), [pointer] * 7).as_pointer())
        null = ir.Constant(pointer, None)
        builder.call(function, [*(builder.inttoptr(a, pointer) for a in args[1:]), null, null, null])
        return context.get_dummy_value()

    return signature, generate


@njit(cache=True)
def tabulate(address, coefficients, constants, out):
    """out[p] (n, c) of the expression at `address` for coefficients (n, k) and constants (l,)."""
    places = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0])  # an interval: no expression here depends on it
    out[:] = 0.0
    for p in range(len(coefficients)):
        _call(address, out[p:].ctypes.data, coefficients[p:].ctypes.data, constants.ctypes.data, places.ctypes.data)
