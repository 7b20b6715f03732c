"""What is asked of an effect besides that it says enough."""

from types import SimpleNamespace

import numpy as np

from ident.diagnosis.evidence import weigh
from ident.diagnosis.last_fit import _ended
from ident.diagnosis.weighing import is_itself


def test_a_change_of_the_model_shows_in_the_parameters_that_it_has(tiny):
    """Columns that a change lets in are any law: by them alone a left-out offset was told as a base that is
    turned by 0.03 degrees."""
    rng = np.random.default_rng(0)
    M = 400
    law, change = rng.normal(size=M), rng.normal(size=M)
    effect = SimpleNamespace(changes_model=True, linear=(), parameters_of=lambda place: ())
    for y, itself in ((law, False), (law + change, True)):
        m = tiny["metric"](tiny["rows"](np.ones((M, 1)), y + 0.1 * rng.normal(size=M)), 0.1)
        r = SimpleNamespace(
            term=SimpleNamespace(effect=effect, place=None),
            columns={0: np.column_stack([law, change])},
            sizes=np.ones(2),
        )
        assert is_itself(m, r, weigh(m, r.columns), 8.3, 0.01) is itself


def test_a_shape_that_ends_where_its_search_does_is_none():
    shapes = (SimpleNamespace(name="rho", grid=(0.4, 0.95)), SimpleNamespace(name="own", grid=(0.0, 0.3)))
    term = SimpleNamespace(effect=SimpleNamespace(nonlinear=shapes))

    def found(**values):
        told = {k: SimpleNamespace(value=v, at_bound=at) for k, (v, at) in values.items()}
        return SimpleNamespace(term=term, parameters=told)

    assert _ended(found(rho=(0.98, True), own=(0.1, False)))
    assert not _ended(found(rho=(0.7, False), own=(0.0, True)))  # a search begins at 0
