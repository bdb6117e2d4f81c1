"""Signed permutations: what they do to rows, and which of them are mirrors."""

import jax.numpy as jnp
import numpy as np
import pytest

from coachable.envs.symmetry.signed_permutation import SignedPermutation

SWAP = SignedPermutation((1, 0, 2), (-1, -1, 1))


def test_numbers_change_places_and_signs():
    row = np.array([1.0, 2.0, 3.0])
    np.testing.assert_array_equal(SWAP(row), [-2.0, -1.0, 3.0])
    np.testing.assert_array_equal(SWAP(np.stack([row, 2 * row])), [[-2.0, -1.0, 3.0], [-4.0, -2.0, 6.0]])
    np.testing.assert_array_equal(SWAP(jnp.asarray(row)), [-2.0, -1.0, 3.0])
    assert SWAP(row.astype(np.float32)).dtype == np.float32
    assert SWAP(jnp.asarray(row, jnp.float32)).dtype == jnp.float32
    assert SWAP.moved == (0, 1)


def test_a_mirror_undoes_itself():
    assert SWAP.is_involution
    assert SignedPermutation((0, 1, 2), (1, 1, 1)).is_involution
    assert not SignedPermutation((1, 2, 0), (1, 1, 1)).is_involution
    assert not SignedPermutation((1, 0), (1, -1)).is_involution


def test_two_side_by_side_are_one():
    both = SWAP.around(SignedPermutation((1, 0), (1, 1)), len(SWAP.sources))
    np.testing.assert_array_equal(both(np.arange(5.0)), [-1.0, -0.0, 2.0, 4.0, 3.0])


@pytest.mark.parametrize(("sources", "signs"), [((0, 0), (1, 1)), ((0, 1), (1,)), ((0, 1), (1, 2))])
def test_what_is_none_is_refused(sources, signs):
    with pytest.raises(ValueError, match=r"no permutation|one sign"):
        SignedPermutation(sources, signs)
