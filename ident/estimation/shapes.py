"""The parameters inside a study's effects: starts screened, then Gauss and Newton with bounds, all at once.

At every point the equations are linear in the rigid parameters, the sizes and the steps of the shapes
(terms.py), so one weighted least squares gives all of them: variable projection in the form of Golub and
Pereyra (Inverse Problems 19, 2003). A step that does not lower the loss is halved; a shape that a step takes
to its bound stays there while the loss would fall beyond. Where an effect reads the model (a load, a delayed
torque) its columns follow the estimate until both stand still.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ident.equations.attaching import Streams, attach, attach_fine
from ident.equations.columns import Columns
from ident.equations.fine import FineSegment
from ident.equations.fitted import FittedModel
from ident.equations.observation import RecordingSystem
from ident.equations.placing import layout_of, terms_of
from ident.equations.prepared import Prepared, travel_seen
from ident.equations.terms import Term, plain, with_terms
from ident.errors import StudyError
from ident.estimation.least_squares import Estimate, restrict, solve, weighted_factor
from ident.estimation.solving import estimate_all
from ident.estimation.starts import fine_signals, started
from ident.progress import Progress, silent
from ident.recordings.study import Study
from modelgen.geometry.place import Layout

TURNS = 40
STILL = 1e-3  # of a standard deviation: a step below it is none
NEARLY = 0.03  # the same on strided signals, whose point is where the search of all samples begins
AWAKE = 0.1  # of a size: what columns of shapes are off by, and a step with them, where it is not made anew
HELD = 1_500_000  # samples of the identify recordings that are held, strided, while searching
WORTH = 1e-4  # of weighted squares that a step must gain: a hundredth of a standard deviation
IDLE = 2  # turns without gain that a search goes on where effects read the model
HALVINGS = 6
LEAST_SHARE = 0.05  # of a step that goes back on the one before
TRIED = 6  # turns after which one start is taken before another


@dataclass(frozen=True, slots=True)
class Extended:
    """A study's effects at the point found, and the equations about it.

    columns: with the terms' parameters; held (b,): where a parameter stands that is not in a fit; at_bound:
    names of shapes that the search stopped at.
    """

    terms: tuple[Term, ...]
    columns: Columns
    model: FittedModel | None
    systems: tuple[RecordingSystem, ...]
    held: np.ndarray
    at_bound: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def allowed(self) -> np.ndarray:
        """(b,) bool: parameters that a fit may move."""
        return np.array([name not in self.at_bound for name in self.columns.parameters])

    def at(self, chi: np.ndarray) -> tuple[Term, ...]:
        """The terms at an estimate chi (b,)."""
        return tuple(_moved(self.columns, self.terms, chi))

    def inside(self, estimate: Estimate) -> Estimate:
        """With shapes that fewer parameters take out of their bounds held where their columns were made
        about, as nothing but that is known of them there. (Of a counterbalance without two inertias the
        reduced fit had rho = 1.04, where its length is no number.)"""
        bounds = _bounds(self.columns, self.terms)
        outside = estimate.active & ((estimate.chi < bounds[:, 0]) | (estimate.chi > bounds[:, 1]))
        return restrict(estimate, estimate.active & ~outside) if outside.any() else estimate

    def groups(self) -> list[tuple[frozenset[str], frozenset[str]]]:
        """Sizes and shapes of each term: its shapes mean nothing without a size. Those of a change of the
        model are what it is, and stay when parameters that it only lets in go."""
        groups = []
        for t in self.terms:
            sizes, shapes = t.names[: len(t.unknown)], t.names[len(t.unknown) :]
            groups.append((frozenset(() if t.effect.changes_model else sizes), frozenset(shapes)))
        return groups


def extend(
    prepared: Prepared,
    systems: Sequence[RecordingSystem],
    cutoff_hz: float,
    progress: Progress = silent,
    begin: Sequence[Term] | None = None,
    rough: bool = False,
) -> Extended:
    """The study's effects fitted on the identify recordings, and every system with their columns.

    `begin`: terms to begin with, where they are known; `rough`: on strided signals only. Raises StudyError
    for effects that cannot act.
    """
    study, columns = prepared.study, prepared.columns
    if not study.effects:
        return Extended((), columns, None, tuple(systems), np.zeros(len(columns.parameters)))
    fitted = [system for system in systems if system.role == "identify"]
    streams = {stream.label: (stream, bank) for stream, bank in zip(prepared.streams, prepared.banks)}
    layout = _layout(prepared)
    terms = tuple(begin) if begin is not None else terms_of(study, columns, layout)
    if columns.gain_columns and any(term.free or not plain(term) for term in terms):
        raise StudyError(
            str(study.file),
            "effects",
            "parameters inside an effect cannot be found together with drive_gains: identify; give the "
            "gains, or hold the parameters with fixed:",
        )
    progress("fitting the effects of the study")
    estimate, _ = estimate_all(fitted, study, columns)
    vs = {label: bank.vs for label, (_, bank) in streams.items() if bank.vs is not None}
    model = FittedModel(columns, layout.robot, estimate.chi, vs)
    samples = sum(system.samples for system in fitted)
    open_starts = any(set(t.effect.nonlinear_names) - set(t.theta) for t in terms)
    fine = None
    if open_starts or (samples < HELD and any(t.free or not plain(t) for t in terms)):
        fine = fine_signals(prepared, fitted, streams, cutoff_hz)
    if open_starts and fine is not None:
        trials = (
            _Search(study, fitted, streams, model, start, cutoff_hz, fine)
            for start in started(study, fitted, fine, model, terms)
        )
        search = _best(trials, progress)
    else:
        search = _Search(study, fitted, streams, model, terms, cutoff_hz, fine)
    notes = search.run(progress)
    if fine is not None and not rough:
        search.fine = None
        notes = search.run(progress)
    wide, terms = search.columns, search.terms
    others = [system for system in systems if system.role != "identify"]
    more = attach(others, streams, search.model, terms, cutoff_hz)
    done = {system.label: system for system in (*search.systems, *more)}
    every = tuple(done[system.label] for system in systems)
    notes += tuple(f"{name} stands at the end of the range that is searched" for name in search.at_bound)
    return Extended(terms, wide, search.model, every, _held(wide, terms), search.at_bound, notes)


def _best(trials: Iterable[_Search], progress: Progress) -> _Search:
    """The one that leaves least after some steps, channels weighed alike in all of them."""
    best: tuple[float, _Search] | None = None
    sigma: np.ndarray | None = None
    for trial in trials:
        trial.sigma = sigma
        loss = trial.tried(progress)
        sigma = trial.sigma
        if best is None or loss < best[0]:
            best = loss, trial
    assert best is not None  # there is a start where one is asked for
    return best[1]


def declared(prepared: Prepared) -> tuple[Term, ...]:
    """The study's effects where they begin. Raises StudyError."""
    study = prepared.study
    return terms_of(study, prepared.columns, _layout(prepared)) if study.effects else ()


def _layout(prepared: Prepared) -> Layout:
    return layout_of(prepared.study, prepared.columns, travel_seen(prepared.streams))


def _held(columns: Columns, terms: Sequence[Term]) -> np.ndarray:
    """(b,) zeros, but for shapes: the point that their columns were made about."""
    shapes = {n: x for t in terms for n, x in list(zip(t.names, t.at))[len(t.unknown) :]}
    return np.array([shapes.get(name, 0.0) for name in columns.parameters])


def _bounds(columns: Columns, terms: Sequence[Term]) -> np.ndarray:
    """(b, 2) of the shapes; what is none has no bounds."""
    shapes = {
        name: t.bounds[shape]
        for t in terms
        for name, shape in zip(t.names[len(t.unknown) :], t.free, strict=True)
    }
    return np.array([shapes.get(name, (-np.inf, np.inf)) for name in columns.parameters])


def _moved(columns: Columns, terms: Sequence[Term], chi: np.ndarray) -> tuple[Term, ...]:
    place = {name: k for k, name in enumerate(columns.parameters)}
    return tuple(term.moved(chi[[place[name] for name in term.names]]) for term in terms)


def _relaxed(share: float, before: np.ndarray, step: np.ndarray) -> float:
    """The share of a step to take, all of it at most, so that the next is none where steps (b,), in standard
    deviations, go on as from the one before (of which `share` was taken) to this one. (Irons and Tuck, A
    version of the Aitken accelerator for computer iteration, 1969. Of an AIRBOT a delay, whose columns read
    the model that it changes, went to and fro by five deviations until the turns ended.)"""
    change = before - step
    square = float(change @ change)
    told = share * float(before @ change) / square if before.any() and square > 0 else 1.0
    return float(np.clip(told, LEAST_SHARE, 1.0)) if told > 0 else 1.0


@dataclass(frozen=True, slots=True)
class _Point:
    """x (b,): chi that effects read, then the terms' parameters; sizes (b,): everything linear as it fits
    best at the shapes of x; the loss there; the estimate about it."""

    x: np.ndarray
    sizes: np.ndarray
    loss: float
    estimate: Estimate


class _Search:
    """Gauss-Newton from given terms; afterwards terms, systems and model are those of the point found."""

    def __init__(
        self,
        study: Study,
        fitted: Sequence[RecordingSystem],
        streams: Streams,
        model: FittedModel,
        terms: Sequence[Term],
        cutoff_hz: float,
        fine: Sequence[FineSegment] | None,
    ) -> None:
        self.study, self.fine = study, fine
        self.fitted, self.streams, self.model, self.cutoff_hz = fitted, streams, model, cutoff_hz
        self.terms = tuple(terms)
        self.columns = with_terms(model.columns, terms)
        self.systems: tuple[RecordingSystem, ...] = ()
        self.at_bound: tuple[str, ...] = ()
        curved = {n for t in terms for n in (t.names[len(t.unknown) :] if plain(t) else t.names)}
        self.curved = np.array([name in curved for name in self.columns.parameters])
        self.low, self.high = _bounds(self.columns, terms).T
        self.sigma: np.ndarray | None = None

    def run(self, progress: Progress) -> tuple[str, ...]:
        """Search; -> notes for the user."""
        point, notes = self._searched(progress)
        chi = point.estimate.chi
        outside = (chi < self.low) | (chi > self.high)
        if outside.any():  # at rest beside a bound, with an estimate beyond it: it stands at the bound
            at = np.where(outside, np.clip(chi, self.low, self.high), point.x)
            self._evaluate(_moved(self.columns, self.terms, at), self.model)
        return notes

    def tried(self, progress: Progress) -> float:
        """The loss after some steps, where it stands then."""
        return self._searched(progress, TRIED)[0].loss

    def _searched(self, progress: Progress, turns: int = TURNS) -> tuple[_Point, tuple[str, ...]]:
        point, idle = self._awake(self._evaluate(self.terms, self.model)), 0
        before, share = np.zeros(len(point.x)), 1.0
        for turn in range(turns):
            progress(f"fitting the effects of the study, step {turn + 1}")
            reads = self.model.asked.estimate
            if not self.curved.any() and not reads:
                self.terms = _moved(self.columns, self.terms, point.estimate.chi)
                return point, ()
            aim = np.clip(point.estimate.chi, self.low, self.high)
            still = STILL if self.fine is None else NEARLY
            std, b = point.estimate.std, len(self.model.chi)
            far = np.abs(aim - point.x) > still * np.maximum(std, 1e-300)
            if not far[b:].any() and not (reads and far[:b].any()):
                return point, ()
            step = (aim - point.x) / np.where(std > 0, std, np.inf)
            share, before = _relaxed(share, before, step), step
            new = self._stepped(point, point.x + share * (aim - point.x), reads)
            idle = idle + 1 if new and abs(new.loss - point.loss) < WORTH else 0
            if new is None or idle > (IDLE if reads else 0):
                return point, ()
            point = self._awake(new)
        return point, ("the parameters inside the effects did not come to rest: their values are rough",)

    def _awake(self, point: _Point) -> _Point:
        """The sizes where they fit best at the shapes that are there: columns of shapes are made with them.
        (A shape without a size has none; with a size of the other sign a counterbalance's search went uphill,
        and ended at 9 % of error where 0.7 are left.)"""
        sizes = np.clip(np.where(self.curved, point.x, point.sizes), self.low, self.high)
        b = len(self.model.chi)  # of which a term's columns are not made
        if not self.curved.any() or (np.abs(sizes - point.x) <= AWAKE * np.abs(sizes))[b:].all():
            return point
        return self._evaluate(_moved(self.columns, self.terms, sizes), self.model)

    def _stepped(self, point: _Point, aim: np.ndarray, reads: bool) -> _Point | None:
        """The next point, halved until the loss falls. Where only sizes are left to find in effects that read
        the model, its loss is that of another model each time: steps are halved that go far astray."""
        kept = self.terms, self.model, self.systems, self.at_bound
        worse = 0.1 * point.loss if reads and not np.isfinite(self.low).any() else 0.0
        for _ in range(HALVINGS):
            model = replace(self.model, chi=aim[: len(self.model.chi)])
            new = self._evaluate(_moved(self.columns, kept[0], aim), model)
            if new.loss < point.loss + worse:
                return new
            self.terms, self.model, self.systems, self.at_bound = kept
            if new.loss < point.loss + WORTH:
                return None
            aim = (aim + point.x) / 2
        return None

    def _evaluate(self, terms: tuple[Term, ...], model: FittedModel) -> _Point:
        """Go to a point: (b,) where it is, its loss, the estimate about it with bounds in force."""
        if self.fine is not None:
            systems = attach_fine(self.fitted, self.fine, model, terms)
        else:
            systems = attach(self.fitted, self.streams, model, terms, self.cutoff_hz)
        held = _held(self.columns, terms)
        estimate, factors = estimate_all(systems, self.study, self.columns, None, held)
        bound = ((held <= self.low) & (estimate.chi < self.low)) | (
            (held >= self.high) & (estimate.chi > self.high)
        )
        if bound.any():
            estimate, factors = estimate_all(systems, self.study, self.columns, ~bound, held)
        self.sigma = estimate.sigma if self.sigma is None else self.sigma
        point = np.concatenate([model.chi, *(term.at for term in terms)])
        R = weighted_factor(factors, self.sigma, len(point))
        sizes, _, loss = solve(R, estimate.active & ~self.curved, np.where(self.curved, point, 0.0))
        names = np.array(self.columns.parameters)
        self.terms, self.model, self.systems = terms, model, systems
        self.at_bound = tuple(names[bound])
        return _Point(point, sizes, loss, estimate)
