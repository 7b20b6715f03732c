"""Every place where every effect could act, and a fast first ranking of them.

Columns that depend on the motion alone are filtered once (the library); a first ranking takes one matrix
product per channel. Ripple of any wavenumber is ranked from the spectrum of the residual over the position.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ident.diagnosis.model_view import LEFT_OUT, ModelView
from ident.diagnosis.rows import Rows
from ident.diagnosis.scoring import Columns, System
from ident.diagnosis.terms import Context, Term, columns, fine_columns
from modelgen.effects import Effect, catalogue

OWN_TERMS = tuple(LEFT_OUT)
DYNAMIC = (
    "load_dependent_friction",
    "drive_gain_error",
    "sensor_crosstalk",
    "time_delay",
    "joint_elasticity",
    "backlash",
)
ONE_BY_ONE = ("joint_coupling",)  # its linear parameters are candidates alone and in pairs
SPECIFIC_FIRST_WAVE = 6.0  # 1/rad; below it ripple is compared column by column
CONTRACT = (
    "stribeck_friction", "nonlinear_viscous_friction", "asymmetric_friction", "load_dependent_friction",
    "thermal_friction", "hysteresis", "torque_ripple", "spring", "joint_elasticity", "joint_coupling",
    "base_tilt",
    "payload_change", "external_force", "drive_gain_error", "sensor_crosstalk", "offset_drift", "time_delay",
    "backlash",
)  # fmt: skip
EXTENSIONS = ("power_law_friction", "counterbalance")


@dataclass(frozen=True, slots=True)
class Ranked:
    """A candidate with its gain by the linear screen."""

    term: Term
    gain: float
    positive: bool  # signs are as physics allows


@dataclass(frozen=True, slots=True)
class Products:
    """Of one channel's library on the fitted rows."""

    mask: np.ndarray  # (M,)
    model: np.ndarray  # (k, K)
    gram: np.ndarray  # (K, K)


@dataclass(frozen=True)
class Library:
    """Columns that do not depend on the estimate: per channel one matrix (M, K) and the terms of its
    columns."""

    terms: tuple[tuple[Term, ...], ...]  # per channel
    starts: tuple[np.ndarray, ...]  # first column of each term
    values: tuple[np.ndarray, ...]  # (M, K)
    _products: dict[int, Products] = field(default_factory=dict)

    def products(self, c: int, system: System) -> Products:
        """Products with the model's columns on the fitted rows; they outlive a step."""
        if c not in self._products:
            mask = system.identify_mask(c)
            masked = self.values[c] * mask[:, None]
            self._products[c] = Products(mask, system.bank.base[c].T @ masked, self.values[c].T @ masked)
        return self._products[c]


def channels_of(effect: Effect, joint: int, view: ModelView) -> list[tuple[int, ...]]:
    """Places where an effect of one joint can enter: each tuple is one candidate's channels."""
    motor = [c for c, name in enumerate(view.channels) if name[:5] != "tau_l" and view.joint_of[c] == joint]
    sensor = [c for c, name in enumerate(view.channels) if name[:5] == "tau_l" and view.joint_of[c] == joint]
    if effect.kind == "motion":
        return [tuple(range(len(view.channels)))]
    if effect.channel == "sensor":
        return [(c,) for c in sensor]
    if effect.channel == "any":
        return [(c,) for c in motor + sensor]
    if motor and sensor:  # before the gear the motor's torque alone shows it, behind it both do
        return [tuple(motor), (*motor, *sensor)]
    return [tuple(motor or sensor)]


def all_terms(view: ModelView, without: Sequence[str]) -> list[Term]:
    """Candidates of one joint or pair of joints (loads of the whole robot are searched by `events`)."""
    known = catalogue()
    left_out = {w.partition(":")[0] for w in without}
    names = [*CONTRACT, *EXTENSIONS, *(o for o in OWN_TERMS if o in left_out)]
    names += [name for name, e in known.items() if e.common and name not in (*names, *OWN_TERMS)]  # new files
    difference = view.channels[0].startswith("tau_d")
    out: list[Term] = []
    for effect in (known[name] for name in names if name in known):
        if effect.kind == "load" or (difference and effect.kind == "motion"):
            continue
        for joint in range(view.n):
            for places in channels_of(effect, joint, view):
                sources = [s for s in range(view.n) if s != joint] if effect.joints == "pair" else [None]
                for source in sources:
                    for terms in _groups(effect):
                        out.append(Term(effect, joint, places, terms, source=source))
        if effect.name == "time_delay" and not difference:
            out.append(Term(effect, None, tuple(range(len(view.channels))), effect.linear_names))
    return out


def _groups(effect: Effect) -> list[tuple[str, ...]]:
    if effect.name in ONE_BY_ONE:
        return [("Fv",), ("Ia",), ("Fv", "Ia"), ("Fv", "Ia", "Fc")]
    if effect.name == "backlash":
        return [("gap",), ("gap", "drop"), ("drop",)]  # gravity need not show the shift, nor the gear a drop
    return [tuple(p.name for p in effect.linear if not p.optional)]


def grid_points(effect: Effect) -> list[dict[str, float]]:
    """Grid of the nonlinear parameters (the product of their grids)."""
    points: list[dict[str, float]] = [{}]
    for p in effect.nonlinear:
        grid: Sequence[float] = p.grid
        if effect.name == "torque_ripple":
            grid = [k for k in p.grid if k <= SPECIFIC_FIRST_WAVE]
        points = [{**point, p.name: value} for point in points for value in grid]
    return points


def build_library(terms: Sequence[Term], context: Context) -> Library:
    """Filter every static column once. A term of several channels stands with its first one."""
    C = len(context.view.channels)
    chosen: list[list[Term]] = [[] for _ in range(C)]
    blocks: list[list[np.ndarray]] = [[] for _ in range(C)]
    for term in terms:
        if term.effect.name in DYNAMIC or len(term.channels) != 1:
            continue
        c = term.channels[0]
        for theta in grid_points(term.effect):
            placed = term.at(**theta)
            chosen[c].append(placed)
            blocks[c].append(fine_columns(placed, context))
    starts, values = [], []
    for c in range(C):
        widths = [b.shape[1] for b in blocks[c]]
        starts.append(np.cumsum([0, *widths])[:-1])
        fine = np.hstack(blocks[c]) if widths else np.zeros((len(context.rows.fine.t), 0))
        values.append(context.rows.low_pass @ fine)
    return Library(tuple(tuple(t) for t in chosen), tuple(starts), tuple(values))


def screen(library: Library, system: System) -> list[Ranked]:
    """Gain of every library term alone, in units of log-likelihood at the present weights."""
    out: list[Ranked] = []
    for c, terms in enumerate(library.terms):
        if not terms:
            continue
        L = library.values[c]
        products = library.products(c, system)
        raw = np.concatenate([products.model, system.extra[c].T @ (L * products.mask[:, None])])
        XtL = system.basis.T @ raw * system.weight[c]
        v = (L.T @ (system.residual[c] * products.mask)) * system.weight[c]
        edges = [*library.starts[c].tolist(), L.shape[1]]
        for term, a, b in zip(terms, edges[:-1], edges[1:]):
            G = products.gram[a:b, a:b] * system.weight[c]
            out.append(_gain(term, G - XtL[:, a:b].T @ XtL[:, a:b], G, v[a:b]))
    return out


def _gain(term: Term, left: np.ndarray, G: np.ndarray, v: np.ndarray) -> Ranked:
    p = len(v)
    scale = np.sqrt(np.maximum(np.diag(G), 1e-300))
    A = left / np.outer(scale, scale)
    if not np.all(np.isfinite(A)) or np.min(np.diag(A)) < 1e-6:
        return Ranked(term, 0.0, True)
    try:
        a = np.linalg.solve(A + 1e-9 * np.eye(p), v / scale)
    except np.linalg.LinAlgError:
        return Ranked(term, 0.0, True)
    gain = 0.5 * float(a @ (v / scale))
    signs = {q.name: q.sign for q in term.effect.linear}
    ok = all(not (signs.get(name) == "positive" and x < 0) for name, x in zip(term.terms, a))
    return Ranked(term, gain, ok)


def screen_dynamic(terms: Sequence[Term], context: Context, system: System, done: set) -> list[Ranked]:
    """The same for terms whose columns follow the estimate or stand in several channels."""
    out = []
    for term in terms:
        if (term.effect.name not in DYNAMIC and len(term.channels) == 1) or term.key in done:
            continue
        for theta in grid_points(term.effect):
            placed = term.at(**theta)
            out.append(screen_columns(placed, _kept_columns(placed, context), system))
    return out


def _kept_columns(term: Term, context: Context) -> Columns:
    """Columns of a point of the grid; those that depend on the motion alone are kept from step to step."""
    follows = term.effect.name in DYNAMIC or "tau_link" in term.effect.needs
    if follows or term.effect.kind != "column" or term.joint is None:
        return columns(term, context)
    turn_over = context.rows.fine.turn_over[term.joint]
    theta = tuple(sorted(term.theta.items()))
    key = ("column", term.effect.name, term.joint, term.source, term.terms, theta, turn_over)
    if key not in context.cache:
        context.cache[key] = context.rows.low_pass @ fine_columns(term, context)
    return dict.fromkeys(term.channels, context.cache[key])


def screen_columns(term: Term, cols: Columns, system: System) -> Ranked:
    """Linear gain of columns in any channels."""
    p = next(iter(cols.values())).shape[1]
    b = system.basis.shape[1]
    G, A, v = np.zeros((p, p)), np.zeros((b, p)), np.zeros(p)
    for c, z in cols.items():
        masked = z * (system.identify_mask(c) * system.weight[c])[:, None]
        G += masked.T @ z
        A += system.project(c, masked)
        v += masked.T @ system.residual[c]
    return _gain(term, G - A.T @ A, G, v)


def ripple_peaks(
    effect: Effect, context: Context, system: System, channel: int, count: int = 4
) -> list[float]:
    """Wavenumbers where the residual's spectrum over the joint's position is largest, relative to the
    filter's gain."""
    rows: Rows = context.rows
    joint = context.view.joint_of[channel]
    use = system.rows_of(system.folds.identify) & system.keep[channel]
    u = context.rows.low_pass.T @ np.where(use, system.residual[channel], 0.0)
    q = rows.fine.q[:, joint]
    top = effect.nonlinear[0].high
    width = np.pi / (4 * top)
    place = np.floor((q - q.min()) / width).astype(int)
    if place.max() > 200_000:
        return []
    density = np.bincount(place, weights=u)
    size = 1 << int(np.ceil(np.log2(2 * np.pi / (0.08 * width))))
    spectrum = np.abs(np.fft.rfft(density, max(size, len(density)))) ** 2
    k = 2 * np.pi * np.arange(len(spectrum)) / (max(size, len(density)) * width)
    speed = np.abs(rows.fine.dq[rows.filter.centres[use], joint])
    counts, edges = np.histogram(speed, bins=80)
    middle = 0.5 * (edges[1:] + edges[:-1])
    passed = 1.0 / (1.0 + (np.outer(k, middle) / (2 * np.pi * rows.filter.cutoff_hz)) ** 16)
    norm = 0.5 * passed @ counts
    score = spectrum / np.maximum(norm, 0.02 * len(speed))
    score[(k < SPECIFIC_FIRST_WAVE - 0.5) | (k > top)] = 0.0
    peaks = []
    span = max(2 * np.pi / max(np.ptp(q), 0.1), 0.2)
    for _ in range(count):
        best = int(np.argmax(score))
        if score[best] <= 0:
            break
        peaks.append(float(k[best]))
        score[np.abs(k - k[best]) < span] = 0.0
    return peaks
