"""The model with what was found: the effects' columns added to the symbolic model, which is derived again.

The loop works with columns that NumPy makes from the effects' terms. Here the same terms go through the
generator: model + effects -> C -> kernel. At some instants of the recordings the columns and the torque of
that kernel are compared with those that were fitted. Gains, delays, elasticities and loads are no columns of
a regressor; they are named with the reason.
"""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import generated
from generated.errors import GeneratedError
from ident.diagnosis.diagnosis import Diagnosis
from ident.diagnosis.findings import Finding
from ident.diagnosis.model_view import LEFT_OUT, split_name
from ident.diagnosis.state import Found, State
from ident.diagnosis.terms import Term, fine_columns, state_values
from ident.equations.columns import unit_of
from ident.progress import Progress, silent
from modelgen.base_parameters.rules import derive_rules
from modelgen.dynamics.models import model as model_called
from modelgen.emit.effect_columns import WHAT, EffectColumn, effect_columns
from modelgen.emit.regenerate import Plan, files, write
from modelgen.errors import ModelgenError
from modelgen.geometry.robot import Robot
from modelgen.geometry.robot_file import load_robot

# what the generator may meet in an effect or a robot that it does not know; a mistake of ours is among them
FAILURES = (
    GeneratedError, ModelgenError, ArithmeticError, AssertionError, AttributeError, LookupError,
    NotImplementedError, OSError, TypeError, ValueError,
)  # fmt: skip
INSTANTS = 400
SATURATED = 20.0  # widths of the turn-over: from there tanh is the sign to the last digit
SIGNALS = {
    "t": ("s", "time since the first sample of the recording"),
    "tau_link": ("N m", "torque that the gear passes to the link, without friction and rotor"),
    "z": ("", "state of the effect, from the path of q"),
}


@dataclass(frozen=True, slots=True)
class NotColumn:
    """A finding that is not in the regenerated model, and why."""

    effect: str
    joints: tuple[int, ...]
    reason: str


@dataclass(frozen=True, slots=True)
class Value:
    """A parameter of the regenerated model. `of`: the request that brought it, "" for the model's own."""

    name: str
    value: float
    unit: str
    std: float | None = None
    of: str = ""


@dataclass(frozen=True)
class RegeneratedModel:
    """`effects` are requests as `regenerate-model --effect` takes them, or names of terms that the study had
    left out and the model has itself."""

    robot_source: str
    model: str
    payloads: tuple[str, ...]
    requests: tuple[str, ...]  # columns that were added to the symbolic model
    effects: tuple[str, ...]  # requests, and terms that the study had left out
    not_columns: tuple[NotColumn, ...]
    parameters: tuple[Value, ...]  # chi of the regenerated model, in its order
    payload_parameters: tuple[Value, ...]  # and of the study's coupled drives
    fixed: tuple[Value, ...]  # extra inputs that are numbers
    signals: tuple[str, ...]  # extra inputs that the caller gives at every instant
    instants: int
    column_difference: float  # of a column, relative to its largest value
    torque_difference: float  # relative to the channel's largest torque

    @property
    def largest_relative_difference(self) -> float:
        return max(self.column_difference, self.torque_difference)

    def document(self) -> dict[str, Any]:
        """For diagnosis.json."""
        return {
            "effects": list(self.effects),
            "not_columns": _as_dicts(self.not_columns),
            "largest_relative_difference": self.largest_relative_difference if self.effects else None,
        }


def _as_dicts(items: Sequence[NotColumn]) -> list[dict[str, Any]]:
    return [{"effect": n.effect, "joints": list(n.joints), "reason": n.reason} for n in items]


def with_regenerated(diagnosis: Diagnosis, progress: Progress = silent) -> Diagnosis:
    """The diagnosis with its regenerated model. Whatever goes wrong here becomes a note: what was found
    stays."""
    study = diagnosis.study
    if not diagnosis.findings or study is None:
        return diagnosis
    progress("regenerating the model with what was found", 0.98)
    try:
        made = regenerate(
            study.robot_source, study.model, diagnosis.findings, diagnosis.outcome.last, study.payloads
        )
    except FAILURES as error:
        return _noted(diagnosis, error)
    return replace(diagnosis, regenerated=made)


def write_model(diagnosis: Diagnosis, folder: Path) -> Diagnosis:
    """Write the regenerated model's files into `folder`; without success the diagnosis with a note."""
    made = diagnosis.regenerated
    if made is None or not made.effects:
        return diagnosis
    try:
        write(model_files(made), folder)
    except FAILURES as error:
        return _noted(replace(diagnosis, regenerated=None), error)
    return diagnosis


def _noted(diagnosis: Diagnosis, error: Exception) -> Diagnosis:
    reason = " ".join(str(error).split()) or type(error).__name__
    note = f"the model was not regenerated with what was found: {reason}"
    return replace(diagnosis, notes=(*diagnosis.notes, note))


@dataclass(frozen=True, slots=True)
class _Placed:
    """A found term, its request, and the generated columns of that request."""

    found: Found
    term: Term
    request: str
    names: tuple[str, ...]  # of the columns, in the order of term.terms
    columns: tuple[EffectColumn, ...]


def regenerate(
    robot_source: str,
    model_name: str,
    findings: Sequence[Finding],
    state: State,
    payloads: Sequence[str] = (),
) -> RegeneratedModel:
    """Add the found columns to the model, generate it, compare with what was fitted.

    Raises GeneratedError or ModelgenError where the generator refuses.
    """
    robot = load_robot(robot_source)
    context, view = state.context, state.context.view
    plain = view.model
    chi = np.zeros(len(plain.parameters))
    chi[view.kept] = context.chi[: len(view.kept)]
    found = {f.term.key: f for f in state.found if f.term is not None}
    taken = {*plain.standard_parameters, *plain.parameters}
    placed: list[_Placed] = []
    restored: list[Found] = []
    refused: list[NotColumn] = []
    requests: list[str] = []
    for finding in findings:
        here = found.get(finding.term.key)
        if here is None or here.term is None:
            continue
        term = here.term
        reason = f"{WHAT[term.effect.kind]}, it is no column" if term.effect.kind != "column" else ""
        if not reason and _left_out(term, state):
            restored.append(here)
            continue
        if not reason:
            entry, reason = _place(here, term, view.channels, robot, model_name, requests, taken)
            if entry is not None:
                placed.append(entry)
                requests = list(dict.fromkeys([*requests, entry.request]))
        if reason:
            refused.append(NotColumn(term.effect.name, finding.joints, reason))
    own, more = _restore(restored, state, chi)
    refused += more
    effects = (*own, *requests)
    if not effects:
        return RegeneratedModel(
            robot_source, model_name, tuple(payloads), (), (), tuple(refused), (), (), (), (), 0, 0.0, 0.0
        )
    model = generated.load(robot_source, model_name, effects=tuple(requests)) if requests else plain
    extra, fixed, signals = _extra_inputs(placed, state)
    values = np.concatenate([chi, np.zeros(len(model.parameters) - len(chi))])
    place = {name: k for k, name in enumerate(model.parameters)}
    for entry in placed:
        values[[place[name] for name in entry.names]] = entry.found.coefficients
    columns, torque, instants = _differences(model, values, place, placed, restored, state, extra)
    spread = {finding.term.key: finding.covariance for finding in findings}
    of = {name: entry for entry in placed for name in entry.names}
    listed = []
    for name, value in zip(model.parameters, values):
        listed.append(_value(name, float(value), of.get(name), spread, plain))
    beyond = [
        Value(name, float(value), unit_of(name, plain.prismatic))
        for name, value in zip(view.parameters[len(view.kept) :], context.chi[len(view.kept) :])
    ]
    return RegeneratedModel(
        robot_source,
        model_name,
        tuple(payloads),
        tuple(requests),
        effects,
        tuple(refused),
        tuple(listed),
        tuple(beyond),
        tuple(_with_std(v, placed, spread) for v in fixed),
        tuple(signals),
        instants,
        columns,
        torque,
    )


def _place(
    found: Found,
    term: Term,
    channels: tuple[str, ...],
    robot: Robot,
    model_name: str,
    requests: list[str],
    taken: set[str],
) -> tuple[_Placed | None, str]:
    """The term's columns behind those already asked for, or the reason why there are none."""
    assert term.joint is not None
    request = f"{term.effect.name}:{term.joint + 1}"
    if term.source is not None:
        request += f":source_joint={term.source + 1}"
    model = model_called(model_name)
    if term.effect.channel == "motor" and any(channels[c][:5] == "tau_l" for c in term.channels):
        request += ":side=link"  # behind the gear
    at = requests.index(request) if request in requests else len(requests)
    try:
        before = effect_columns(robot, model, requests[:at], taken)
        own = effect_columns(robot, model, [*requests[:at], request], taken)[len(before) :]
    except ModelgenError as error:
        return None, str(error).partition(": ")[2].partition(";")[0] or str(error)
    names = list(term.effect.terms)
    chosen = []
    for name in term.terms:
        for k, column in enumerate(own):
            rows = {row for row, sign in column.channels if sign > 0}
            if (
                names[k % len(names)] == name
                and rows == set(term.channels)
                and len(rows) == len(column.channels)
            ):
                chosen.append(column)
    if len(chosen) != len(term.terms):
        return None, "acts in other torques than the column that can be generated"
    return _Placed(found, term, request, tuple(c.name for c in chosen), own), ""


def _left_out(term: Term, state: State) -> list[int]:
    """Numbers of the generated model's parameters that this term is and that the study had left out."""
    view = state.context.view
    kept = set(view.kept.tolist())
    kinds = LEFT_OUT.get(term.effect.name, ())
    return [
        k
        for k, name in enumerate(view.model.parameters)
        if k not in kept and term.joint is not None
        if split_name(name)[0] in kinds and split_name(name)[1] == term.joint + 1
    ]


def _restore(restored: list[Found], state: State, chi: np.ndarray) -> tuple[list[str], list[NotColumn]]:
    """Put left-out terms into the model's own parameters `chi` (changed in place).

    A sensor's friction stands in both rows of model C (Fcl), a motor's in one (Fcm): coefficients by channel
    become parameters by solving that small system.
    """
    view = state.context.view
    names: list[str] = []
    refused = []
    for key in dict.fromkeys((f.term.effect.name, f.term.joint) for f in restored if f.term is not None):
        group = [f for f in restored if f.term is not None and (f.term.effect.name, f.term.joint) == key]
        first = group[0].term
        assert first is not None and first.joint is not None
        numbers = _left_out(first, state)
        wanted = np.zeros(len(view.channels))
        for f in group:
            assert f.term is not None
            wanted[list(f.term.channels)] += f.coefficients[0]
        acts = np.zeros((len(view.channels), len(numbers)))
        for c, k in view.model.nonzeros:
            if int(k) in numbers:
                acts[int(c), numbers.index(int(k))] = 1.0
        solution = np.linalg.lstsq(acts, wanted, rcond=None)[0]
        request = f"{first.effect.name}:{first.joint + 1}"
        if np.abs(acts @ solution - wanted).max() > 1e-9 * max(np.abs(wanted).max(), 1e-30):
            reason = "acts in other torques than the model's own column"
            refused.append(NotColumn(first.effect.name, (first.joint + 1,), reason))
            restored[:] = [f for f in restored if f not in group]
            continue
        chi[numbers] = solution
        names.append(request)
    return names, refused


def _extra_inputs(placed: list[_Placed], state: State) -> tuple[dict[str, Any], list[Value], list[str]]:
    """{name: number or (N,)} of every extra input, those that are numbers, those that are signals."""
    context = state.context
    values: dict[str, Any] = {}
    fixed: list[Value] = []
    signals: list[str] = []
    for entry in placed:
        term, effect = entry.term, entry.term.effect
        assert term.joint is not None
        theta = effect.complete(term.theta)
        units = {p.name: p.unit for p in effect.nonlinear}
        for label in dict.fromkeys(name for column in entry.columns for name in column.extra_inputs):
            if label in values:
                continue
            name = _plain_name(label, term)
            if name in theta:
                values[label] = theta[name]
                fixed.append(Value(label, float(theta[name]), units[name], None, entry.request))
                continue
            if name == "z":
                q = context.rows.fine.q[:, term.joint]
                values[label] = state_values(effect, q, theta, context.rows.fine.pieces)
            else:
                values[label] = context.signals(term)[name]
            signals.append(label)
    return values, fixed, signals


def _plain_name(label: str, term: Term) -> str:
    """vs of "vs2", of "vs2_stribeck_friction" or of "vs2_2"."""
    assert term.joint is not None
    return re.sub(rf"{term.joint + 1}(_{term.effect.name})?(_\d+)?$", "", label)


def _differences(
    model: Any,
    values: np.ndarray,
    place: dict[str, int],
    placed: list[_Placed],
    restored: list[Found],
    state: State,
    extra: dict[str, Any],
) -> tuple[float, float, int]:
    """Largest relative difference of columns and of torque between the kernel and the fit; instants used."""
    context, view = state.context, state.context.view
    fine = context.rows.fine
    pick = _instants(placed, state)
    q, dq, ddq, sign = (np.ascontiguousarray(x[pick]) for x in (fine.q, fine.dq, fine.ddq, fine.sign))
    given = {k: v if np.ndim(v) == 0 else np.ascontiguousarray(v[pick]) for k, v in extra.items()}
    W = model.regressor(q, dq, ddq, sign=sign, extra=given)
    expected = np.zeros((len(pick), len(view.channels)))
    for c, (index, columns) in enumerate(view.entries):
        own = index < len(view.kept)
        expected[:, c] = columns[np.ix_(pick, np.flatnonzero(own))] @ context.chi[index[own]]
    worst = 0.0
    for entry in placed:
        fitted = fine_columns(entry.term, context)[pick]
        expected[:, list(entry.term.channels)] += (fitted @ entry.found.coefficients)[:, None]
        for k, name in enumerate(entry.names):
            scale = max(float(np.abs(fitted[:, k]).max()), 1e-30)
            for c in entry.term.channels:
                worst = max(worst, float(np.abs(W[:, c, place[name]] - fitted[:, k]).max()) / scale)
    for f in restored:
        assert f.term is not None
        expected[:, list(f.term.channels)] += (fine_columns(f.term, context)[pick] @ f.coefficients)[:, None]
    tau = model.torque(q, dq, ddq, values, sign=sign, extra=given)
    scales = np.maximum(np.abs(expected).max(axis=0), 1e-30)
    return worst, float((np.abs(tau - expected) / scales).max()), len(pick)


def _instants(placed: list[_Placed], state: State) -> np.ndarray:
    """Indices into the fine signals, evenly over all runs; the sum of two rates of a pair is not near zero,
    because the generated column has its plain sign."""
    fine = state.context.rows.fine
    good = np.ones(len(fine.t), dtype=bool)
    for entry in placed:
        j, s = entry.term.joint, entry.term.source
        if s is not None and j is not None and "sign_sum" in entry.term.effect.needs:
            width = max(fine.sign_width[j], fine.sign_width[s])
            good &= np.abs(fine.dq[:, j] + fine.dq[:, s]) > SATURATED * width
    usable = np.flatnonzero(good)
    if not len(usable):
        raise GeneratedError("no instant of the recordings is fast enough to compare the columns")
    return usable[np.linspace(0, len(usable) - 1, min(INSTANTS, len(usable))).astype(int)]


def _value(name: str, value: float, entry: _Placed | None, spread: dict, model: Any) -> Value:
    if entry is None:
        return Value(name, value, unit_of(name, model.prismatic))
    k = entry.names.index(name)
    units = {p.name: p.unit for p in entry.term.effect.linear}
    return Value(name, value, units[entry.term.terms[k]], _std(spread, entry.term, k), entry.request)


def _with_std(value: Value, placed: list[_Placed], spread: dict) -> Value:
    entry = next(e for e in placed if e.request == value.of)
    names = entry.term.effect.nonlinear_names
    k = len(entry.term.terms) + names.index(_plain_name(value.name, entry.term))
    return replace(value, std=_std(spread, entry.term, k))


def _std(spread: dict, term: Term, k: int) -> float | None:
    C = spread.get(term.key)
    return None if C is None or k >= len(C) else float(np.sqrt(max(C[k, k], 0.0)))


def model_files(made: RegeneratedModel) -> dict[str, str]:
    """Name -> text of the C, header and description as `regenerate-model --effect` writes them, and of
    parameters.json. Raises ModelgenError."""
    robot = load_robot(made.robot_source)
    out: dict[str, str] = {}
    for label in made.payloads or (None,):
        rules = {made.model: derive_rules(robot, made.model, label)}
        out |= files(Plan(robot, label, made.requests, rules), lambda *_: None)
    out.pop("rules.md", None)
    out.pop("paper_comparison.md", None)
    out["parameters.json"] = json.dumps(_parameters(made), indent=1) + "\n"
    return out


def _parameters(made: RegeneratedModel) -> dict[str, Any]:
    """Content of parameters.json: chi in the order of the C, and its extra inputs."""
    return {
        "model": made.model,
        "effects": list(made.effects),
        "parameters": {v.name: _entry(v) for v in made.parameters},
        "other_parameters": {v.name: _entry(v) for v in made.payload_parameters},
        "extra_inputs": {
            **{v.name: _entry(v) for v in made.fixed},
            **{name: _signal(name) for name in made.signals},
        },
        "not_columns": _as_dicts(made.not_columns),
        "compared_with_the_fit": {
            "instants": made.instants,
            "largest_relative_difference_of_columns": made.column_difference,
            "largest_relative_difference_of_torque": made.torque_difference,
        },
        "remark": "The fit used a friction sign that turns over gradually; the C takes sign(dq).",
    }


def _entry(value: Value) -> dict[str, Any]:
    out: dict[str, Any] = {"value": value.value, "unit": value.unit}
    if value.std is not None:
        out["std"] = value.std
    if value.of:
        out["effect"] = value.of
    return out


def _signal(name: str) -> dict[str, str]:
    plain = next((s for s in ("tau_link", "z", "t") if name.startswith(s)), "")
    unit, meaning = SIGNALS.get(plain, ("", "signal of the effect"))
    return {"signal": meaning, "unit": unit}
