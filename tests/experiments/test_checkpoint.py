"""Arrays come back from a checkpoint to the bit, and damage is noticed."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from coachable.experiments.run_folder.checkpoint import load_arrays, save_arrays
from coachable.foundation.errors import RunFolderError
from coachable.foundation.trees import arrays_of, tree_from

TREE = {
    "weights": (jnp.arange(6.0).reshape(2, 3), jnp.float32(2.0)),
    "count": jnp.int32(3),
    "key": jnp.uint32([1, 2]),
}


def test_a_tree_goes_through_a_checkpoint_to_the_bit(tmp_path):
    path = tmp_path / "group-000.safetensors"
    save_arrays(path, arrays_of(TREE, "state"), {"updates": 7})
    arrays, about = load_arrays(path)
    again = tree_from(TREE, arrays, "state")
    assert about == {"updates": 7}
    jax.tree.map(np.testing.assert_array_equal, again, TREE)


@pytest.mark.parametrize("where", [10, 200, -5])
def test_one_changed_byte_anywhere_in_a_checkpoint_is_noticed(tmp_path, where):
    path = tmp_path / "group-000.safetensors"
    save_arrays(path, arrays_of(TREE, "state"), {"updates": 7})
    data = bytearray(path.read_bytes())
    data[where] ^= 1
    path.write_bytes(data)
    with pytest.raises(RunFolderError, match=r"group-000\.safetensors is damaged"):
        load_arrays(path)


def test_a_tree_of_another_shape_is_refused():
    arrays = arrays_of(TREE, "state")
    with pytest.raises(KeyError, match="weights"):
        tree_from(TREE | {"weights": (jnp.zeros((3, 2)), jnp.float32(0))}, arrays, "state")
