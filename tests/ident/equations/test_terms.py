"""Terms about their point, block by block."""

import numpy as np
import pytest
from dry_arm import opened_dry_arm

from ident.equations.terms import Chain, Term, tangent, torque_of
from modelgen.effects import effect
from modelgen.geometry.place import Place

HALO = 60


def test_a_state_goes_on_beside_a_term_that_reads_it(tmp_path):
    """Whether a torque that comes late is linear in its size is asked of a few samples: from these the
    presliding before it went on into the next block."""
    state = opened_dry_arm(tmp_path, lambda q, dq: np.sign(dq), 250.0, 3)
    motion = state.motions[0]
    terms = [
        Term(
            "hysteresis:1", effect("hysteresis"), Place(0, side="motor"), {"width": 0.3}, (2.0,), ("width",)
        ),
        Term("time_delay", effect("time_delay"), Place(), {}, (0.004,)),
    ]
    whole = Chain(state.model, terms)
    expected = tangent(terms[1], motion, whole)
    blocks, half = Chain(state.model, terms), len(motion.t) // 2
    for begin, stop in ((0, half + HALO), (half - HALO, len(motion.t))):
        got = [tangent(term, motion.only(slice(begin, stop)), blocks) for term in terms][1]
        blocks.forget()
    inner = slice(half, len(motion.t) - HALO)
    scale = np.abs(expected.J).max()
    assert np.abs(expected.J[inner] - got.J[HALO : HALO + inner.stop - half]).max() < 1e-9 * scale


def test_a_changed_model_is_the_sum_of_its_changes(tmp_path):
    state = opened_dry_arm(tmp_path, lambda q, dq: np.sign(dq), 250.0, 3)
    motion, its = state.motions[0], effect("torque_sign")
    term = Term("torque_sign:1", its, Place(0, side="motor"))
    changes = its.regressor_change(term.place, {}, motion, state.model)
    expected = sum(state.model.chi[number] * change for number, change in changes.items())
    assert torque_of(term, motion, state.model, {}) == pytest.approx(expected, abs=1e-9)
