"""The classical Runge–Kutta method."""

from collections.abc import Callable

from jaxtyping import Array, Float


def rk4(
    flow: Callable[[Array, Array], Array],
    x: Float[Array, " state"],
    control: Float[Array, " control"],
    h: Float[Array, ""],
) -> Float[Array, " state"]:
    """Return x(t + h) with ẋ = flow(x, u) and u held, one step of order 4 (Kutta, 1901)."""
    k1 = flow(x, control)
    k2 = flow(x + h / 2 * k1, control)
    k3 = flow(x + h / 2 * k2, control)
    k4 = flow(x + h * k3, control)
    return x + h / 6 * (k1 + 2 * (k2 + k3) + k4)
