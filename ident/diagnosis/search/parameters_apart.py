"""What was found, in units of what the model itself gets wrong from one run to the next.

log E counts in the noise that the autoregression sees. A model that lacks more than one thing is wrong in
another way too: fitted to other rows its own parameters come out elsewhere, and further off than noise would
put them. That is what a smooth torque that nobody has a name for looks like from inside the model, and an
effect is a smooth torque as well: along such directions the noise is so many times larger as the parameters
of the two sides are further apart, which the data show (an overdispersion: Wedderburn, Biometrika 61(3),
1974). Of a Stäubli TX40, two seconds fitted, a cubic friction was told by 20 nats of which 4 are left.

An effect that is there moves them together, and that is evidence as well. Channel by channel, r parameters
that both sides determine, d the square of their distance in the noise of the channel,

    log E / kappa + r / 2 ln(d without / d with),   kappa = d with / r, one at least

of the regression of this channel alone: its likelihood ratio where parameters of the sides differ at random,
all directions alike. A factor of the model's torque is asked of all channels in one regression: a channel's
own parameters follow any, and cannot that they are the other channels', too. (Of a Barrett's two torques one
was five times too large, which the parameters of either alone took up.) What others of an effect's own kind
show of such changes says more of it than the parameters do (of_its_kind.py): then kappa is theirs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ident.diagnosis.evidence.evidence import Evidence, weigh
from ident.diagnosis.evidence.given import given_fitted
from ident.diagnosis.evidence.metric import Columns, Metric, Side, orthonormal
from ident.diagnosis.evidence.state import Found, State
from ident.diagnosis.search.exchanged import by_the_fitted
from ident.diagnosis.search.halves import on_halves
from ident.diagnosis.search.of_its_kind import times_noise_of_its_kind

OF_ITS_OWN = float(np.log(2.0))  # of factors, logarithm: of robots as they are 0.85 to 1.26 was found


@dataclass(frozen=True, slots=True)
class Changes:
    """What is left of log E beside such changes [nats]; kappa of the channel that says most; log E itself;
    whether others of its kind told kappa."""

    log_e: float
    kappa: float
    channel: int
    told: float
    of_its_kind: bool = False


def beside_changes(others: State, f: Found, tau: float) -> Changes | None:
    """Of the judged rows, or of what shows it where they alone do not: the halves of the fitted ones, the
    less of the two, the judged ones given these, or these as the judged ones have it; None where nothing
    shows it. Halves of one run come last: what they have of it is told with parameters that they share.
    others: the state without it."""
    m = others.metric
    told = weigh(m, f.columns)
    if told.log_e > tau:
        return _of(others, m, f, told)
    parts = list(on_halves(others, f.columns))
    shown = all(e.log_e > tau for _, e in parts)
    if not shown or any(side.parted for side, _ in parts):
        given = given_fitted(m, m.both, f.columns, f.sizes).of(told)
        if given.log_e > tau:
            return _of(others, m, f, given)
    if not shown:
        m, told = by_the_fitted(others, f.columns)
        return _of(others, m, f, told) if told.log_e > tau else None
    return min((_of(others, side, f, e) for side, e in parts), key=lambda its: its.log_e)


def spoken(m: Metric, f: Found, tau: float) -> Evidence:
    """What the judged rows say of it; of a factor of which they say too little alone, given the fitted rows,
    if that says enough beside what the model's parameters change by from one side to the other. (Five times
    a rokae's second torque is five times its inertia, for the rows that judge; given the fitted ones 27 nats
    say that it is not.) A factor near one has to show on the judged rows alone: a model that lacks something
    makes such of its own, by as many nats. A torque that comes late is asked as a factor is."""
    own = weigh(m, f.columns)
    if own.log_e > tau or f.term is None:
        return own
    asked = f.term.effect.shifts_time or abs(np.log(max(abs(f.term.factor), 1e-12))) > OF_ITS_OWN
    return own if not asked else spoken_given(m, f, own, tau) or own


def spoken_given(m: Metric, f: Found, own: Evidence, tau: float) -> Evidence | None:
    """What the judged rows say of it given the fitted ones, where that is enough, beside what the model's
    parameters change by, too; own: alone."""
    given = given_fitted(m, m.both, f.columns, own.sizes).of(own)
    return given if given.log_e > tau and _by_parameters(m, f, given).log_e > tau else None


def _of(others: State, m: Metric, f: Found, told: Evidence) -> Changes:
    """Beside the changes from the fitted to the judged rows of a metric."""
    its, kappa = _by_parameters(m, f, told), times_noise_of_its_kind(others, m, f)
    return its if kappa is None else Changes(told.log_e / kappa, kappa, its.channel, told.log_e, True)


def _by_parameters(m: Metric, f: Found, told: Evidence) -> Changes:
    if f.term is not None and f.term.factor != 1.0:
        whole, kappa = _of_whole(m, f.columns, told)
        return Changes(whole, kappa, max(f.columns, key=lambda c: told.per_channel[c]), told.log_e)
    white = m.whiten(f.columns)
    nats, kappas = {}, {}
    for c in f.columns:
        distance, parameters = _distances(m, c, white[c] @ told.sizes)
        nats[c], kappas[c] = _left_of(float(told.per_channel[c]), distance, parameters)
    most = max(nats, key=lambda c: told.per_channel[c])
    return Changes(sum(nats.values()), kappas[most], most, told.log_e)


def closer(m: Metric, columns: Columns, told: Evidence) -> float:
    """Nats by which columns of these sizes that act in the fitted rows alone bring the model's parameters
    there closer to those of the judged rows, all channels in one regression."""
    return _of_whole(m, columns, told)[0]


def times_noise(m: Metric, columns: Columns, sizes: np.ndarray) -> float:
    """How many times as much as noise makes them the model's parameters change from the fitted to the judged
    rows beside columns of these sizes, all channels in one regression (squares)."""
    return _of_whole(m, columns, weigh(m, columns, sizes))[1]


def _of_whole(m: Metric, columns: Columns, told: Evidence) -> tuple[float, float]:
    """What is left of log E, and kappa, all channels in one regression."""
    white = m.whiten(columns)
    torque = {c: z @ told.sizes for c, z in white.items()}
    noise = np.where(told.free > 0, told.rss / np.maximum(told.free, 1), 0.0)
    joined = [_joined(m, side, torque, noise) for side in (m.fitted, m.judged)]
    rss = [_left(products) for products in (joined[0] + joined[1], *joined)]
    parameters = rss[1][1] + rss[2][1] - rss[0][1]
    without, with_it = (float(its) for its in rss[0][0] - rss[1][0] - rss[2][0])
    return _left_of(float(told.log_e), (without, with_it), parameters)


def _left_of(log_e: float, distance: tuple[float, float], parameters: int) -> tuple[float, float]:
    """What is left of log E, and kappa, of the parameters' distances without the effect and with it."""
    if not parameters:
        return log_e, 1.0
    before, after = (max(d, parameters) for d in distance)
    kappa = after / parameters
    return log_e / kappa + 0.5 * parameters * float(np.log(before / after)), kappa


def _joined(m: Metric, side: Side, torque: Columns, noise: np.ndarray) -> np.ndarray:
    """Of all channels' columns, their torque, and this less the other torque, in units of the noise (C,)."""
    out = np.zeros((m.B + 2, m.B + 2))
    for c, (places, values) in enumerate(m.X):
        if noise[c] <= 0:  # no row that judges is left there: in no noise at all it would say everything
            continue
        on = side.mask & m.rows.use[c]
        less = m.y[c, on] - torque[c][on] if c in torque else m.y[c, on]
        here = np.column_stack([values[on], m.y[c, on], less]) / np.sqrt(noise[c])
        where = np.array([*places, m.B, m.B + 1])
        out[np.ix_(where, where)] += here.T @ here
    return out


def _distances(m: Metric, c: int, torque: np.ndarray) -> tuple[tuple[float, float], int]:
    """Squares of the distance of a channel's own parameters from the fitted to the judged rows, in its noise,
    without a whitened torque (M,) and with it; how many both sides determine."""
    sides = (m.fitted, m.judged)
    fitted, judged = (_products(m, c, side, torque) for side in sides)
    rss = [_left(products) for products in (fitted + judged, fitted, judged)]
    both, one, other = (ranks for _, ranks in rss)
    parameters = one + other - both
    free = [int((side.mask & m.rows.use[c]).sum()) - ranks for side, (_, ranks) in zip(sides, rss[1:])]
    at = 1 if free[1] > 0 else 0  # as many parameters as rows leave no noise
    noise = max(rss[1 + at][0][1], 1e-300) / max(free[at], 1)
    without, with_it = ((rss[0][0][k] - rss[1][0][k] - rss[2][0][k]) / noise for k in range(2))
    return (float(without), float(with_it)), parameters


def _products(m: Metric, c: int, side: Side, torque: np.ndarray) -> np.ndarray:
    """Of the channel's columns, its torque, and this less the other torque."""
    _, values = m.X[c]
    on = side.mask & m.rows.use[c]
    here = np.column_stack([values[on], m.y[c, on], m.y[c, on] - torque[on]])
    return np.asarray(here.T @ here)


def _left(products: np.ndarray) -> tuple[np.ndarray, int]:
    """Sums of squares (2,) that the model's columns leave of the last two; how many columns count."""
    basis = orthonormal(products[:-2, :-2])
    across = basis.T @ products[:-2, -2:]
    return np.diag(products)[-2:] - np.sum(across**2, axis=0), basis.shape[1]
