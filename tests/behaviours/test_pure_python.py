import subprocess
import sys

FORBIDDEN = ("numpy", "jax", "equinox", "scipy", "torch", "z3", "rich")


def test_describing_a_behaviour_needs_neither_numpy_nor_jax():
    script = (
        f"import sys, coachable.behaviours; print([name for name in {FORBIDDEN!r} if name in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"
