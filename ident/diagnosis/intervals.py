"""Uncertainty of the found terms: linear and nonlinear parameters together, noise correlated in time and
joints.

With every column of the final fit (nonlinear parameters by their sensitivities), the estimate's error is
H^-1 sum_t u_t, u_t = sum_c omega_c x_ct e_ct. Its covariance takes the series u_t with Bartlett's weights
(Newey and West, Econometrica 55, 1987), so neither a coloured torque noise nor joints that share it make
intervals too short; it is widened to the critical values for a finite share of lags (Kiefer and Vogelsang,
Econometric Theory 21, 2005).
"""

from collections.abc import Sequence

import numpy as np

from ident.diagnosis.friction_sign import coulomb_places, coulomb_sizes, softer
from ident.diagnosis.rotor_split import split_sensitivity
from ident.diagnosis.scoring import Columns, make_system
from ident.diagnosis.state import Found, State, both_bank, carried_signs, sensitivity, stack_columns
from ident.diagnosis.terms import Term

LAG_SECONDS = 2.5
LONGEST_LAG = 0.1  # of the rows


def covariances(state: State) -> dict[tuple, np.ndarray]:
    """Covariance (linear used, nonlinear, then the model's parameters that the report divides by) of every
    found term, by the term's key."""
    rows = state.context.rows
    own = [f for f in state.found if not f.lent]
    extra, layout = [], []
    for f in own:
        p = next(iter(f.columns.values())).shape[1]
        names = [] if f.term is None else [q.name for q in f.term.free]
        layout.append((f, p, len(names)))
        extra += [sensitivity(f, name, state.context) for name in names]
    out = {}
    if own:
        extra += turn_overs(state, [f for f in own if f.term is not None])
        extra += [z for z in (split_sensitivity(state, f) for f in own) if z]
        columns = stack_columns(state.bank, [f.columns for f in own] + extra)
        system = make_system(state.bank, columns, state.system.y)
        C = _sandwich(system, rows.filter.cutoff_hz)
        b = state.bank.base.shape[2]
        at, tail = b, b + sum(p for _, p, _ in layout)
        for f, p, k in layout:
            relative = [] if f.term is None else relative_to(f.term, state)
            pick = [*range(at, at + p), *range(tail, tail + k), *relative]
            if f.term is not None:
                out[f.term.key] = C[np.ix_(pick, pick)]
            at, tail = at + p, tail + k
    for f in state.found:
        if f.lent and f.term is not None:
            out[f.term.key] = _lent(state, f)
    return out


def relative_to(term: Term, state: State) -> list[int]:
    """Numbers of the model's parameters that a term's size is reported relative to (Fv of its joint)."""
    view = state.context.view
    if term.joint is None:
        return []
    numbers = [view.number((f"{name}m", f"{name}l"), term.joint) for name in term.effect.context]
    return [] if None in numbers else [k for k in numbers if k is not None]


def turn_overs(state: State, found: Sequence[Found]) -> list[Columns]:
    """Sensitivities to how the friction of each joint with a finding turns over. The turn-over was chosen by
    the data too; what hides behind it (Fs, mu, a delay) is as unsure as it is."""
    rows, view = state.context.rows, state.context.view
    terms = [f.term for f in found if f.term is not None]
    joints = {view.joint_of[c] for t in terms if t.effect.kind != "load" for c in t.channels}
    carried, places = carried_signs(found, state.context), coulomb_places(view)
    out = []
    for joint in sorted(joints & {*carried, *places}):
        size = coulomb_sizes(places.get(joint, []), state.context.chi)
        change = softer(rows, joint)
        own = carried.get(joint, {})
        columns = {
            c: (rows.low_pass @ (change * (size.get(c, 0.0) + own.get(c, 0.0))))[:, None]
            for c in {*size, *own}
        }
        if any(np.any(z) for z in columns.values()):
            out.append(columns)
    return out


def _sandwich(system, cutoff_hz: float) -> np.ndarray:
    """(columns, columns) covariance of the coefficients."""
    use = system.rows_of(system.folds.identify)
    U = np.zeros((system.y.shape[1], system.basis.shape[1]))
    for c in range(len(system.y)):
        e = system.weight[c] * system.residual[c] * system.identify_mask(c)
        X = np.hstack([system.bank.base[c], system.extra[c]]) @ system.basis
        U += X * e[:, None]
    U = U[use]
    lags = max(4, min(int(LAG_SECONDS * 2.5 * cutoff_hz), int(LONGEST_LAG * len(U))))
    S = U.T @ U
    for k in range(1, min(lags, len(U) // 4) + 1):
        G = U[k:].T @ U[:-k]
        S += (1 - k / (lags + 1)) * (G + G.T)
    H = np.linalg.pinv(np.tensordot(system.weight, system.gram[list(system.folds.identify)].sum(0), 1))
    C = H @ S @ H
    rows = float(use.sum())
    C *= rows / max(rows - system.basis.shape[1] / max(len(system.y), 1), 1.0)
    share = (lags + 1) / max(len(U), 1)  # Bartlett's sum is short for finite lags: fixed-b critical values
    C *= ((1.96 + 2.9694 * share + 0.416 * share**2 - 0.5324 * share**3) / 1.96) ** 2
    return system.basis @ C @ system.basis.T


def _lent(state: State, f) -> np.ndarray:
    """The same for a term estimated on identify and validate runs together."""
    rows = state.context.rows
    own = [sensitivity(f, q.name, state.context) for q in f.term.free]
    columns = stack_columns(state.bank, [*(g.columns for g in state.found), *own])
    system = make_system(both_bank(state.bank, rows), columns, rows.y)
    C = _sandwich(system, rows.filter.cutoff_hz)
    at, width = state.bank.base.shape[2], C.shape[0]
    for g in state.found:
        p = next(iter(g.columns.values())).shape[1]
        if g is f:
            pick = [*range(at, at + p), *range(width - len(own), width)]
            return C[np.ix_(pick, pick)]
        at += p
    raise AssertionError
