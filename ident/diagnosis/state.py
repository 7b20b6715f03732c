"""The model with what was found so far, fitted: columns, system and context move together.

Terms whose columns follow the estimate (gain, delay, elasticity, tilt, load) are recomputed a few times;
nonlinear parameters of all found terms are refined together by Gauss-Newton on the projected problem.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ident.diagnosis.friction_sign import settle_sign, sharpened
from ident.diagnosis.model_view import ModelView
from ident.diagnosis.rows import Rows
from ident.diagnosis.scoring import Bank, Columns, Folds, System, make_bank, make_system
from ident.diagnosis.terms import Context, Term, columns, fine_columns

LITTLE = 1e-3  # s
MOVING = ("measurement", "motion")
LASTING = ("payload", "wrench", "arm", "sensitivity", "filtered", "play", "shifted", "column")


@dataclass(frozen=True)
class Found:
    """A term in the model with its fitted linear coefficients; `nuisance` columns have no term."""

    term: Term | None
    columns: Columns
    coefficients: np.ndarray
    label: str = ""
    lent: bool = False  # estimated on identify and validate rows together: identify alone cannot see it


@dataclass(frozen=True)
class State:
    """Fitted model. `system` columns: model parameters, then the columns of each found term in order."""

    context: Context
    system: System
    found: tuple[Found, ...]
    bank: Bank  # model columns at the kept instants

    @property
    def folds(self) -> Folds:
        return self.bank.folds

    @property
    def terms(self) -> tuple[Term, ...]:
        return tuple(f.term for f in self.found if f.term is not None)


def base_columns(rows: Rows, view: ModelView) -> np.ndarray:
    """(channels, M, b) filtered model columns."""
    out = np.zeros((len(view.channels), len(rows.t), len(view.parameters)))
    for c, (index, values) in enumerate(view.entries):
        out[c][:, index] = rows.low_pass @ values
    return out


def first_state(rows: Rows, view: ModelView, folds: Folds) -> State:
    bank = make_bank(base_columns(rows, view), rows.keep, folds)
    rows, view, bank = settle_sign(rows, view, bank)
    system = make_system(bank, no_columns(bank), rows.y)
    context = _context(rows, view, system.coefficients, (), {})
    return State(context, system, (), bank)


def no_columns(bank: Bank) -> np.ndarray:
    return np.zeros((*bank.base.shape[:2], 0))


def _context(rows, view, chi, found: tuple[Found, ...], size) -> Context:
    b = len(view.parameters)
    torque = view.torque(chi[:b])
    context = Context(rows, view, chi[:b], torque, _load(rows, view, chi[:b]), size)
    for f in found:
        if f.term is not None and f.term.effect.kind == "column":
            extra = fine_columns(f.term, context) @ f.coefficients
            for c in f.term.channels:
                torque[c] += extra
    return context


def _load(rows: Rows, view: ModelView, chi: np.ndarray) -> np.ndarray:
    """(n, N) torque that the gears pass on: the sensor's where motor and sensor are both measured."""
    ddq = rows.fine.ddq
    out = np.stack([view.link_torque(chi, j) - view.drive_inertia(j) * ddq[:, j] for j in range(view.n)])
    if any(c.startswith("tau_m") for c in view.channels):
        for c, name in enumerate(view.channels):
            if name.startswith("tau_l"):
                out[view.joint_of[c]] = rows.y_fine[c]
    return out


def refit(state: State, found: list[Found], turns: int | None = None) -> State:
    """State with these found terms; coefficients of the given ones are starting values."""
    context, view, rows = state.context, state.context.view, state.context.rows
    b = len(view.parameters)
    moving = any(f.term is not None and (f.term.effect.kind in MOVING or _follows(f.term)) for f in found)
    current = list(found)
    system = state.system
    current = [replace(f, lent=f.term is not None and _needs_all(f.term, rows, state.folds)) for f in current]
    if turns is None:
        turns = 4 if moving else 1
    previous = None
    for _turn in range(turns):
        size = {f.term.key: f.coefficients for f in current if f.term is not None}
        context = _context(rows, view, context.chi, tuple(current), size)
        context.cache.update(_lasting(state.context.cache))
        cols = [
            f.columns if f.term is None or (_turn == 0 and _static(f)) else columns(f.term, context)
            for f in current
        ]
        current = [replace(f, columns=c) for f, c in zip(current, cols)]
        system, current = solve(state.bank, rows, current)
        context = replace(context, chi=system.coefficients[:b])
        a = np.concatenate([f.coefficients for f in current]) if current else np.zeros(0)
        if previous is not None and np.allclose(previous, a, rtol=1e-3, atol=1e-12):
            break
        previous = a
    size = {f.term.key: f.coefficients for f in current if f.term is not None}
    old = context.cache
    context = _context(rows, view, system.coefficients[:b], tuple(current), size)
    context.cache.update(_lasting(old))
    return State(context, system, tuple(current), state.bank)


def _lasting(cache: dict) -> dict:
    """Parts of a cache that outlive a new estimate: exact ones, and the sensitivities that only rank."""
    return {k: v for k, v in cache.items() if k[0] in LASTING}


def _needs_all(term: Term, rows: Rows, folds: Folds) -> bool:
    """True for a load on a validate run, one on the whole of the only identify run, and one on a recording
    that the others must predict: they cannot know of it."""
    if term.run is None or rows.runs[term.run].role == "test":
        return False
    if folds.by_recording:
        return True
    fitted = [i for i, r in enumerate(rows.runs) if r.role == "identify"]
    return rows.runs[term.run].role == "validate" or (term.window is None and fitted == [term.run])


def solve(bank: Bank, rows: Rows, found: list[Found]) -> tuple[System, list[Found]]:
    """Fit everything; lent terms are estimated first on all runs that may be looked at, then taken off the
    torque."""
    y = rows.y
    out = list(found)
    if any(f.lent for f in found):
        joint = make_system(both_bank(bank, rows), stack_columns(bank, [f.columns for f in found]), y)
        out = _with_coefficients(out, joint.coefficients[bank.base.shape[2] :])
        y = y.copy()
        for f in out:
            if f.lent:
                for c, values in f.columns.items():
                    y[c] -= values @ f.coefficients
    own = [i for i, f in enumerate(out) if not f.lent]
    system = make_system(bank, stack_columns(bank, [out[i].columns for i in own]), y)
    for i, f in zip(
        own, _with_coefficients([out[i] for i in own], system.coefficients[bank.base.shape[2] :])
    ):
        out[i] = f
    return system, out


_both: dict[int, tuple[Bank, Bank]] = {}


def both_bank(bank: Bank, rows: Rows) -> Bank:
    """The same model columns with identify and validate rows in one set."""
    if id(bank) not in _both:
        _both.clear()
        roles = np.array([r.role for r in rows.runs])[rows.run]
        _both[id(bank)] = (
            bank,
            make_bank(bank.base, bank.keep, Folds(np.where(roles != "test", 0, -1), (0,), (), False)),
        )
    return _both[id(bank)][1]


def _with_coefficients(found: list[Found], a: np.ndarray) -> list[Found]:
    out, at = [], 0
    for f in found:
        p = next(iter(f.columns.values())).shape[1]
        out.append(replace(f, coefficients=a[at : at + p]))
        at += p
    return out


def _static(f: Found) -> bool:
    return f.term is not None and f.term.effect.kind == "column" and not _follows(f.term) and bool(f.columns)


def _follows(term: Term) -> bool:
    return "tau_link" in term.effect.needs or term.effect.name == "base_tilt"


def stack_columns(bank: Bank, cols: list[Columns]) -> np.ndarray:
    """(channels, M, all p) of columns that live on some channels each."""
    widths = [next(iter(c.values())).shape[1] for c in cols]
    out = np.zeros((*bank.base.shape[:2], sum(widths)))
    at = 0
    for c, p in zip(cols, widths):
        for channel, values in c.items():
            out[channel, :, at : at + p] = values
        at += p
    return out


def sensitivity(f: Found, name: str, context: Context) -> Columns:
    """d(contribution)/d(nonlinear parameter) by central differences."""
    assert f.term is not None
    theta = f.term.effect.complete(f.term.theta)
    parameter = next(p for p in f.term.effect.nonlinear if p.name == name)
    h = 1e-3 * max(abs(theta[name]), 1e-3 * (parameter.high - parameter.low))
    up = columns(f.term.at(**{name: theta[name] + h}), context)
    down = columns(f.term.at(**{name: theta[name] - h}), context)
    return {c: ((up[c] - down[c]) @ f.coefficients / (2 * h))[:, None] for c in up}


def resettle(state: State) -> State:
    """Choose the turn-over of the friction signs again beside what was found."""
    delays = [f for f in state.found if f.term is not None and f.term.effect.name == "time_delay"]
    late = {c: float(f.coefficients[0]) for f in delays for c in f.columns}
    context, system = state.context, state.system
    tangents = stack_columns(state.bank, [_later(f, context) for f in delays])
    extra = np.concatenate([system.extra, tangents], axis=2)
    carried = carried_signs(state.found, context)
    rows, view, bank = settle_sign(
        context.rows, context.view, state.bank, extra, system.y, 1, RESETTLE, carried, late
    )
    return state if bank is state.bank else _with_signs(state, rows, view, bank)


def carried_signs(found: Sequence[Found], context: Context) -> dict[int, dict[int, np.ndarray]]:
    """{joint: {channel: (N,)}}: what found terms multiply the sign of their joint's rate with."""
    rows = context.rows

    def with_sign(value: float) -> Context:
        sign = np.full_like(rows.fine.sign, value)
        return replace(context, rows=replace(rows, fine=replace(rows.fine, sign=sign)))

    on, off = with_sign(1.0), with_sign(0.0)
    out: dict[int, dict[int, np.ndarray]] = {}
    for f in found:
        if f.term is None or f.term.joint is None or "sign_dq" not in f.term.effect.needs:
            continue
        amplitude = (fine_columns(f.term, on) - fine_columns(f.term, off)) @ f.coefficients
        joint = out.setdefault(f.term.joint, {})
        for c in f.term.channels:
            joint[c] = joint.get(c, 0.0) + amplitude
    return out


def _later(f: Found, context: Context) -> Columns:
    """What a little more delay would change: the column of a found delay is a secant, this the tangent."""
    delay, filtered = float(f.coefficients[0]), context.rows.filter
    torque = context.torque[list(f.columns)].T
    change = (filtered.matrix(delay + LITTLE) - filtered.matrix(delay - LITTLE)) @ torque / (2 * LITTLE)
    return {c: change[:, [i]] for i, c in enumerate(f.columns)}


def sharpen(state: State, joints: Sequence[int]) -> State:
    """The state with friction that turns over at once on these joints."""
    return _with_signs(state, *sharpened(state.context.rows, state.context.view, state.bank, joints))


def _with_signs(state: State, rows: Rows, view: ModelView, bank: Bank) -> State:
    context = replace(state.context, rows=rows, view=view)
    found = [
        replace(f, columns=columns(f.term, context))
        if f.term is not None and f.term.effect.kind == "column"
        else f
        for f in state.found
    ]
    return refit(State(context, state.system, state.found, bank), found)


RESETTLE = 8.0  # log-likelihood


def refine(state: State, steps: int = 2) -> State:
    """Gauss-Newton over the nonlinear parameters of all found terms, with shorter steps on failure."""
    for _ in range(steps):
        places = [(i, p) for i, f in enumerate(state.found) if f.term is not None for p in f.term.free]
        if not places:
            return state
        cols = [f.columns for f in state.found if not f.lent]
        extra = [sensitivity(state.found[i], p.name, state.context) for i, p in places]
        system = make_system(state.bank, stack_columns(state.bank, cols + extra), state.system.y)
        delta = system.coefficients[-len(extra) :]
        now = objective(state)
        scale, better = 1.0, None
        for _halving in range(3):
            found = list(state.found)
            for (i, p), d in zip(places, delta):
                term = found[i].term
                assert term is not None
                value = term.effect.complete(term.theta)[p.name]
                limit = 0.5 * abs(value) if p.low > 0 else 0.3 * (p.high - p.low)
                value = float(np.clip(value + scale * np.clip(d, -limit, limit), p.low, p.high))
                found[i] = replace(found[i], term=term.at(**{p.name: value}), columns={})
            found = [
                replace(f, columns=columns(f.term, state.context))
                if f.term is not None and not f.columns
                else f
                for f in found
            ]
            trial = refit(state, found, turns=1)
            if objective(trial) < now:
                better = trial
                break
            scale /= 4
        if better is None:
            return state
        gain = now - objective(better)
        state = better
        if gain < 0.05:
            break
    return state


def objective(state: State) -> float:
    """Minus log-likelihood of the identify rows, noise levels profiled out."""
    system = state.system
    N = system.count[list(system.folds.identify)].sum(axis=0)
    return float(np.sum(N / 2 * np.log(np.maximum(system.rss, 1e-30))))
