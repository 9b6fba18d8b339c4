"""Complete linkage, the slope rule and the non-dominated archive against their definitions."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.cluster.hierarchy import cut_tree, linkage
from scipy.spatial.distance import pdist

from mofit.optimize.pareto_front import nondominated
from mofit.optimize.population_clusters import cluster


def test_tight_groups_are_never_cut_and_the_rule_joins_the_nearest_two():
    rng = np.random.default_rng(0)
    centres = np.repeat([[0.1, 0.1], [0.9, 0.1], [0.5, 0.9]], 8, axis=0)
    found = cluster(centres + rng.normal(0, 0.01, centres.shape))
    assert found.count == 2  # r still falls steeply from 2 to 3 clusters, and no more after 3
    assert [len(set(found.labels[k : k + 8])) for k in (0, 8, 16)] == [1, 1, 1]


@given(st.integers(0, 10_000), st.integers(2, 25), st.integers(1, 4))
def test_radii_and_number_follow_their_definition(seed, size, dimension):
    points = np.random.default_rng(seed).random((size, dimension))
    found = cluster(points)
    merges = linkage(points, method="complete")
    radii = np.zeros(size)
    for k in range(1, size + 1):
        labels = cut_tree(merges, n_clusters=k)[:, 0]
        groups = [points[labels == label] for label in np.unique(labels)]
        radii[k - 1] = np.mean([pdist(group).max() / 2 if len(group) > 1 else 0.0 for group in groups])
    np.testing.assert_allclose(found.radii, radii, atol=1e-12)
    falls = [k for k in range(1, size) if radii[k - 1] - radii[k] > radii[0] / (size - 1) + 1e-13]
    assert found.count == (max(falls) if falls else 1)


def test_equal_points_are_one_cluster():
    assert cluster(np.full((5, 2), 0.3)).count == 1


@given(
    arrays(float, st.tuples(st.integers(1, 30), st.integers(1, 4)), elements=st.sampled_from([0.0, 1.0, 2.0, np.nan]))
)
def test_front_is_what_the_definition_says(objectives):
    usable = np.isfinite(objectives).all(axis=1)
    expected = []
    for i, a in enumerate(objectives):
        others = objectives[usable]
        dominated = np.any(np.all(others <= a, axis=1) & np.any(others < a, axis=1))
        repeated = any(np.array_equal(a, objectives[k]) for k in range(i))
        if usable[i] and not dominated and not repeated:
            expected.append(i)
    assert nondominated(objectives).tolist() == expected
