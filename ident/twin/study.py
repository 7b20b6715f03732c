"""A simulated study: which runs are made, what is recorded of them, what the study says and what it hides."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ident.progress import Progress, silent
from ident.twin.parameters import payload_body, twin_parameters
from ident.twin.requests import EffectRequest, EffectRequestError, parse_effect
from ident.twin.sensors import Sensors, coloured_noise, encoder, measured, noise_level, sampling_times
from ident.twin.sizing import activate
from ident.twin.trajectories import Motion, Reach, fourier, point_to_point, reach
from ident.twin.twin import ActiveEffect, SimulationError, Twin, make_twin, run_twin
from modelgen.dynamics.models import MODELS
from modelgen.geometry.robot import Robot
from modelgen.geometry.robot_file import load_robot

Array = np.ndarray


GOOD = Sensors()


@dataclass(frozen=True, slots=True)
class PlannedRun:
    """One recording to make: a given motion, or `points` of one point to point, or (0) a Fourier series."""

    label: str
    use: str  # identify | validate | test
    duration: float  # s
    points: int = 0
    loaded: bool = False
    motion: Motion | None = None


# The paper's run of 44 points in 90 s, a second motion to identify from, and two the fit never sees.
RUNS = (
    PlannedRun("run1", "identify", 90.0, 44),
    PlannedRun("run2", "identify", 60.0),
    PlannedRun("run3", "validate", 60.0),
    PlannedRun("run4", "test", 60.0, 29),
)
LOADED_RUNS = (PlannedRun("run5", "identify", 90.0, 44, loaded=True),)


@dataclass(frozen=True)
class SimulatedRecording:
    """A table as a recorder writes it: columns t, q1.., tau_m1.. and/or tau_l1.. by name, (N,) each."""

    label: str
    use: str
    payload: str | None
    columns: Mapping[str, Array]


@dataclass(frozen=True)
class SimulatedStudy:
    """Recordings, the study that a user would write about them, and apart from both the truth."""

    robot: Robot
    recordings: tuple[SimulatedRecording, ...]
    study: Mapping[str, Any]
    truth: Mapping[str, Any]
    robot_file: Path | None = field(default=None)


def simulate(
    robot: str | Path,
    model: str = "A",
    effects: tuple[str, ...] = (),
    payload_kg: float | None = None,
    seed: int = 0,
    parameters: Path | None = None,
    sensors: Sensors = GOOD,
    runs: tuple[PlannedRun, ...] | None = None,
    progress: Progress = silent,
    exact: bool = False,
) -> SimulatedStudy:
    """Recordings of a robot whose study does not declare `effects` ("stribeck_friction:4", see requests.py).

    The same arguments give the same numbers, bit for bit. Without `parameters`: those of the paper's Table II
    for kuka_lwr4p, random but physical ones of the seed for other robots. Raises IdentError, ModelgenError,
    GeneratedError.
    """
    model = model.upper()
    if model not in ("A", "B", "C", "D"):
        raise SimulationError(f"--model {model}: there is no such model; choose A, B, C or D.")
    if payload_kg is not None and not 0 < payload_kg < 1e5:
        raise SimulationError(f"--payload {payload_kg:g}: a mass is positive; give it in kg.")
    if seed < 0:
        raise SimulationError(f"--seed {seed}: a seed is not negative; give 0, 1, 2, ...")
    description = load_robot(str(robot), exact)
    requests = [parse_effect(text, description) for text in effects]
    if runs is None:
        runs = RUNS + (LOADED_RUNS if payload_kg is not None else ())
    labels = [run.label for run in runs]
    for text, request in zip(effects, requests):
        if request.recording is not None and request.recording not in labels:
            raise EffectRequestError(
                f"--effect {text}: there is no {request.recording}; runs are {', '.join(labels)}."
            )
    progress(f"deriving {description.name}", 0.0)
    known = twin_parameters(description, parameters, seed)
    own, requests = _own_terms(requests)
    standard = {**known.standard, **_given_terms(own, description, model)}
    twin = make_twin(description, str(robot), standard, exact)
    space = reach(description)
    motions = {run.label: _motion(run, space, seed) for run in runs}
    body = payload_body(payload_kg, known.payload) if payload_kg is not None else None
    fitted = {run.label: motions[run.label] for run in runs if run.use == "identify" and not run.loaded}
    active = []
    for request in requests:
        progress(f"sizing {request.effect.name}")
        request = _windowed(request, runs)
        where = {request.recording: motions[request.recording]} if request.recording else {}
        active.append(activate(request, twin, model, fitted | where))
    recordings = []
    for number, run in enumerate(runs):
        progress(f"simulating {run.label}", number / len(runs))
        carried = body if run.loaded else None
        recordings.append(
            _record(twin, run, motions[run.label], tuple(active), carried, model, sensors, seed)
        )
    progress("simulated", 1.0)
    return SimulatedStudy(
        robot=description,
        recordings=tuple(recordings),
        study=_study(str(robot), model, recordings, own, description) | ({"exact": True} if exact else {}),
        truth=_truth(twin, model, own, active, body, known.source, sensors, seed, runs),
        robot_file=Path(robot) if Path(robot).is_file() else None,
    )


def _motion(run: PlannedRun, space: Reach, seed: int) -> Motion:
    if run.motion is not None:
        return run.motion
    rng = np.random.default_rng([seed, 1, *run.label.encode()])
    if run.points:
        return point_to_point(space, run.points, run.duration, rng)
    return fourier(space, run.duration, rng)


def _windowed(request: EffectRequest, runs: tuple[PlannedRun, ...]) -> EffectRequest:
    """When and where a load acts if the user does not say: in the last run identified without a payload."""
    if not request.effect.windowed:
        return request
    recording = request.recording
    if recording is None:
        recording = [run for run in runs if run.use == "identify" and not run.loaded][-1].label
    if request.effect.all_along:
        return replace(request, recording=recording)
    duration = next(run.duration for run in runs if run.label == recording)
    start, stop = request.start, request.stop
    first, last = request.effect.window or (0.0, None)
    if last is not None:  # it comes and goes
        start = first * duration if start is None else start
        stop = start + (last - first) * duration if stop is None else stop
    elif start is None and stop is None and request.recording is None:
        start = first * duration
    if not (start is None or 0 <= start < duration) or not (stop is None or (start or 0) < stop):
        window = ", ".join(f"{k}={v:g}" for k, v in (("from", start), ("to", stop)) if v is not None)
        raise EffectRequestError(
            f"{request.effect.name}: {window} is no window of {recording}, which lasts {duration:g} s."
        )
    return replace(request, recording=recording, start=start, stop=stop)


def _record(
    twin: Twin,
    run: PlannedRun,
    motion: Motion,
    effects: tuple[ActiveEffect, ...],
    payload: Mapping[str, float] | None,
    model: str,
    sensors: Sensors,
    seed: int,
) -> SimulatedRecording:
    """One recording: the true motion at the recorder's rate, then its sensors."""
    rng = np.random.default_rng([seed, 2, *run.label.encode()])
    t = np.arange(round(run.duration * sensors.rate_hz) + 1) / sensors.rate_hz
    true = run_twin(twin, t, motion.at(t), effects, payload, run.label)
    stamps = sampling_times(run.duration, sensors, rng)
    labels = twin.robot.joint_labels
    columns: dict[str, Array] = {"t": stamps}
    q = encoder(_at(stamps, t, true.q), sensors)
    columns |= {f"q{label}": q[:, k] for k, label in enumerate(labels)}
    for name, wanted in (("tau_m", model in "ACD"), ("tau_l", model in "BCD")):
        noise = coloured_noise(
            true.q.shape, sensors, rng
        )  # drawn always: the motor's noise is that of model A
        if wanted:
            tau = _at(stamps, t, getattr(true, name))
            tau = measured(tau, noise, noise_level(tau, sensors), sensors)
            columns |= {f"{name}{label}": tau[:, k] for k, label in enumerate(labels)}
    return SimulatedRecording(run.label, run.use, "L" if run.loaded else None, columns)


def _at(stamps: Array, t: Array, signal: Array) -> Array:
    """The signal at jittered instants."""
    if np.array_equal(stamps, t):
        return signal
    return np.stack([np.interp(stamps, t, column) for column in signal.T], axis=1)


def _own_terms(requests: list[EffectRequest]) -> tuple[list[EffectRequest], list[EffectRequest]]:
    """Terms of the paper's own model, which the twin has and the study leaves out; and effects beyond it."""
    own = [request for request in requests if request.effect.replaces]
    return own, [request for request in requests if not request.effect.replaces]


def _own_names(request: EffectRequest, robot: Robot, model: str) -> list[str]:
    """Standard parameters that the term stands for in the channels of `model`."""
    assert request.joint is not None
    kinds = [kind for kind in request.effect.replaces if kind in MODELS[model].kinds]
    if not kinds:
        raise SimulationError(f"model {model} does not see {request.effect.name}; use A, C or D.")
    return [f"{kind}{robot.joint_labels[request.joint]}" for kind in kinds]


def _given_terms(own: list[EffectRequest], robot: Robot, model: str) -> dict[str, float]:
    """Values that the user gave to a term of the model: on one side of the gear, none on the other."""
    given: dict[str, float] = {}
    for request in own:
        for value in request.values.values():
            names = _own_names(request, robot, model)
            given |= dict(zip(names, [value] + [0.0] * (len(names) - 1)))
    return given


def _study(
    robot: str, model: str, recordings: list[SimulatedRecording], own: list[EffectRequest], description: Robot
) -> dict[str, Any]:
    """What the user would write: nothing in it tells which effect is hidden."""
    entries = []
    for recording in recordings:
        entry = {"file": f"{recording.label}.parquet", "use": recording.use}
        if recording.payload:
            entry["payload"] = recording.payload
        entries.append(entry)
    study: dict[str, Any] = {"robot": Path(robot).name, "model": model, "recordings": entries}
    if own:
        study["without"] = [
            f"{request.effect.name}:{description.joint_labels[request.joint or 0]}" for request in own
        ]
    return study


def _truth(
    twin: Twin,
    model: str,
    own: list[EffectRequest],
    effects: list[ActiveEffect],
    payload: Mapping[str, float] | None,
    source: str,
    sensors: Sensors,
    seed: int,
    runs: tuple[PlannedRun, ...],
) -> dict[str, Any]:
    labels = twin.robot.joint_labels
    hidden: list[dict[str, Any]] = []
    for request in own:
        value = sum(twin.standard.get(name, 0.0) for name in _own_names(request, twin.robot, model))
        quantity = request.effect.quantities[0].name
        joint = int(labels[request.joint or 0])
        hidden.append({"effect": request.effect.name, "joints": [joint], "parameters": {quantity: value}})
    for e in effects:
        parameters: dict[str, Any] = dict(e.reported)
        if e.request.source_joint is not None:
            parameters["source_joint"] = int(labels[e.request.source_joint])
        window: dict[str, Any] = {"from": e.request.start, "to": e.request.stop}
        window |= {"recording": e.request.recording, "link": e.request.link}
        parameters |= {key: value for key, value in window.items() if value is not None}
        joints = [] if e.request.joint is None else [int(labels[e.request.joint])]
        visible = float(f"{100 * e.visible:.3g}")
        hidden.append(
            {
                "effect": e.name,
                "joints": joints,
                "parameters": parameters,
                "visible_percent": visible,
            }
        )
    return {
        "robot": twin.robot.name,
        "model": model,
        "seed": seed,
        "effects": hidden,
        "parameters_from": source,
        "standard_parameters": dict(twin.standard),
        "payload": dict(payload) if payload else None,
        "sensors": {name: getattr(sensors, name) for name in Sensors.__dataclass_fields__},
        "recordings": {
            run.label: {"use": run.use, "duration": run.duration, "points": run.points} for run in runs
        },
    }
