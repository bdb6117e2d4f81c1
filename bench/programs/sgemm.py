"""NumPy's matrix product in float32 on one thread: this machine's roof over everything a network does."""

from __future__ import annotations

import numpy as np
from threadpoolctl import threadpool_limits  # pyright: ignore[reportMissingImports]


def prepare(size: int, products: int):
    """`products` products of two size × size matrices; units are floating-point operations."""
    threadpool_limits(1, user_api="blas")
    rng = np.random.default_rng(0)
    left, right = rng.standard_normal((2, size, size), dtype=np.float32)
    out = np.empty_like(left)
    np.dot(left, right, out=out)
    # Some OpenBLAS kernels are wrong on processors they were not written for; their speed would mean nothing.
    np.testing.assert_allclose(out, left.astype(float) @ right.astype(float), rtol=1e-3, atol=1e-3)

    def work():
        for _ in range(products):
            np.dot(left, right, out=out)

    return work, products * 2 * size**3
