"""What is asked of `ident excite`, and the experiment that comes of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ident.cores import one_blas_thread
from ident.equations.terms import plain
from ident.excitation.diagnosed import Diagnosed, split_requests
from ident.excitation.holding import Holding
from ident.excitation.information import CRITERIA, Rows, along, criteria, scaled_condition
from ident.excitation.known import ROWS_HZ, Known, as_motion, known_robot
from ident.excitation.limits import Bounds, ExcitationError, bounds_of
from ident.excitation.motion import Planned, basis_for
from ident.excitation.obstacles import keep_out
from ident.excitation.optimal import Optimum, optimise, random_motion
from ident.excitation.point_to_point import PointMotion, best_of_random
from ident.excitation.recorded import Recorded, recorded_motion
from ident.excitation.self_collision import self_collision
from ident.excitation.sensitivity import FINE_HZ, Visible, projector, table
from ident.excitation.separate import RATE_HZ, Projector, Separation
from ident.excitation.so_far import nothing
from ident.excitation.suspects import Separated, suspects, told
from ident.excitation.urdf_shapes import link_places
from ident.progress import Progress, silent
from modelgen.effects import register_folder
from modelgen.geometry.robot import Robot
from modelgen.geometry.robot_file import load_robot

Array = np.ndarray
DURATION = (2.0, 600.0)  # s
MOTIONS = ("fourier", "point_to_point")
UNSEEN = 1e-10  # of the largest singular value: a direction that no row shows
TURN_OVER = 0.05  # of the top speed, of the smooth sign while designing


@dataclass(frozen=True)
class Request:
    """Everything that `ident excite` is told."""

    robot: str
    model: str = "A"
    duration: float = 10.0
    criterion: str = "balanced"
    kind: str = "fourier"
    limits: tuple[str, ...] = ()
    start: tuple[float, ...] | None = None
    harmonics: int | None = None
    starts: int = 2
    iterations: int = 60
    seed: int = 0
    noise: float = 1.0  # percent of the torques' rms
    parameters: Path | None = None
    separate: str | None = None  # NAME:JOINT[:..],NAME:JOINT[:..]
    diagnosis: Path | None = None
    evaluate: Path | None = None
    sensitivity: bool = True
    exact: bool = False  # a URDF's numbers as they are written
    points: tuple[str, ...] = ()
    keep_out: tuple[str, ...] = ()
    self_collision: bool = False
    effects_folder: Path | None = None  # of a user's own effects


@dataclass(frozen=True)
class Experiment:
    """A motion (or a recording) and what it is expected to tell."""

    request: Request
    robot: Robot
    bounds: Bounds
    known: Known
    motion: Planned | Recorded
    sigma: Array
    std: Array  # (b,) expected, SI
    condition: float
    largest_use: tuple[float, str]
    optimum: Optimum | None = None
    separated: Separated | None = None
    visible: tuple[Visible, ...] = ()
    remarks: tuple[str, ...] = ()
    stopped: bool = False  # before all was done

    @property
    def names(self) -> tuple[str, ...]:
        return self.known.parameters

    @property
    def percent(self) -> Array:
        """(b,) std in per cent of the parameter's value; inf of one that is zero."""
        size = np.abs(self.known.chi)
        return np.where(size > 0, 100 * self.std / np.where(size > 0, size, 1.0), np.inf)

    @property
    def seconds(self) -> float:
        return self.motion.duration


def excite(
    request: Request, progress: Progress = silent, stop: Callable[[], bool] = lambda: False
) -> Experiment:
    """Design (or evaluate) the experiment. Raises IdentError, ModelgenError, GeneratedError."""
    check(request)
    with one_blas_thread():
        return _excite(request, progress, stop)


def _excite(request: Request, progress: Progress, stop: Callable[[], bool]) -> Experiment:
    progress("loading the model")
    robot = load_robot(request.robot, request.exact)
    bounds = bounds_of(robot, request.limits)
    if request.start is not None and len(request.start) != robot.n:
        raise ExcitationError(f"--start has {len(request.start)} values for {robot.n} joints; give one each.")
    found = Diagnosed.read(request.diagnosis) if request.diagnosis else None
    if own := request.effects_folder or (found and found.effects_folder):
        register_folder(own)
    if found is not None and found.robot not in ("", robot.name):
        raise ExcitationError(
            f"--from {found.file}: is a diagnosis of {found.robot}, the motion is asked for {robot.name}; "
            "name the robot that was diagnosed."
        )
    if found is not None:  # its findings are of its model's torques, and its fit knows the robot
        numbers = request.parameters or found.fit
        request = replace(request, model=found.model, parameters=numbers)
    known = known_robot(robot, request.robot, request.model, request.parameters, request.exact)
    noise: Any = found.noise_percent if found and found.noise_percent else request.noise
    texts = split_requests(request.separate) if request.separate else None
    if texts is None and found is not None and request.evaluate is None:
        texts = found.suspects()
    holding = _holding(request, known, bounds, progress)
    start = None if request.start is None else np.array(request.start)
    if request.evaluate is not None:
        motion: Any = recorded_motion(request.robot, request.model, request.evaluate, progress, request.exact)
        sigma, optimum, separation = known.sigma(motion.planned, noise), None, None
    else:
        basis = basis_for(request.duration, request.harmonics)
        bounds.check_room(basis.period, start)
        rng = np.random.default_rng([request.seed, 13])
        rest = holding.rest(start, rng)
        trial = random_motion(holding, basis, rest, request.duration, rng, start is not None)
        sigma = known.sigma(_planned(trial), noise)
        separation = None
        if texts:
            turn_over = 0.02 * bounds.dq
            t = np.arange(0.0, basis.period, 1 / RATE_HZ)
            project = Projector(known, as_motion(trial.states(t), t, turn_over), sigma)
            terms = suspects(known, texts, bounds, project)
            separation = Separation(known, basis, sigma, turn_over, terms)
        aim = separation if separation is not None and separation.decides(trial.x) else None
        optimum = _designed(request, holding, known, bounds, basis, sigma, aim, start, progress, stop)
        motion = optimum.motion
    planned = motion.planned if request.evaluate else _planned(motion)
    remarks = _remarks(bounds, known, holding, motion)
    std, number = _expected(known, planned, sigma, motion.duration)
    separated = None
    if texts:
        project = projector(known, planned, sigma)
        terms = suspects(known, texts, bounds, project) if request.evaluate is not None else terms
        settled = separation.contained if separation is not None else ()
        moved, before = "recording" if request.evaluate else "motion", nothing
        if found is not None and request.evaluate is None:  # a recording may be one that was diagnosed
            before = found.so_far
        separated = told(project, terms, moved, settled, before)
    visible: tuple[Visible, ...] = ()
    if request.sensitivity and not stop():
        visible = table(known, bounds, planned, sigma, motion.duration, progress, stop)
    use = (np.nan, "") if request.evaluate else holding.use(motion)
    return Experiment(
        request,
        robot,
        bounds,
        known,
        motion,
        sigma,
        std,
        number,
        use,
        optimum,
        separated,
        visible,
        remarks,
        stop(),
    )


def _holding(request: Request, known: Known, bounds: Bounds, progress: Progress) -> Holding:
    named = bool(request.points or request.keep_out)
    places = link_places(request.robot, request.exact) if named else {}
    boxes = keep_out(known.robot, request.points, request.keep_out, places)
    if not request.self_collision:
        return known.holding(bounds, boxes)
    progress("bodies")
    bodies = self_collision(known.robot, request.robot, bounds, request.exact)
    return known.holding(bounds, boxes, bodies)


def check(request: Request) -> None:
    """Raises ExcitationError for what cannot be asked, before anything slow."""
    low, high = DURATION
    if not low <= request.duration <= high:
        raise ExcitationError(
            f"--duration {request.duration:g}: {low:g} to {high:g} s are designed; repeat it as you like."
        )
    for option, value, known in (
        ("criterion", request.criterion, CRITERIA),
        ("motion", request.kind, MOTIONS),
    ):
        if value not in known:
            raise ExcitationError(f"--{option} {value}: choose {', '.join(known)}.")
    if request.harmonics is not None and not 3 <= request.harmonics <= 20:
        raise ExcitationError(f"--harmonics {request.harmonics}: choose 3 to 20.")
    if not 0 < request.noise < 100:
        raise ExcitationError(f"--noise {request.noise:g}: give percent of the torques' rms, as 1.")
    if request.start is not None and not np.isfinite(request.start).all():
        raise ExcitationError("--start has a value that is no number; give rad, or m, as 0,-1.5,1.5,0,0,0.")
    if request.seed < 0 or request.starts < 1:
        raise ExcitationError("--seed is not negative and --starts at least 1; change them.")
    if request.separate and request.kind == "point_to_point":
        raise ExcitationError("--separate designs Fourier motions; leave --motion point_to_point out.")


def _planned(motion: Planned, rate_hz: float = FINE_HZ) -> Any:
    t = np.arange(0.0, motion.period, 1 / rate_hz)
    return as_motion(motion.states(t), t)


def _designed(  # type: ignore[no-untyped-def]
    request, holding, known: Known, bounds, basis, sigma, separation, start, progress, stop
) -> Optimum:
    criterion = criteria(known.chi, known.of_bodies)[request.criterion]
    weight = np.ones_like(sigma) if request.criterion == "bodies" else sigma
    rows = Rows(known.model, weight, TURN_OVER * bounds.dq)
    if request.kind == "point_to_point":

        def value(motion: PointMotion) -> float:
            A = rows(*motion.states(np.arange(0.0, motion.period, 0.05))[:3])
            return criterion(A.reshape(-1, A.shape[2]))[0]

        return best_of_random(holding, request.duration, value, request.seed, start, progress, stop)
    starts, iterations = request.starts, request.iterations
    if separation is not None:  # its slopes cost more, those of effects that move the link most
        quick = all(plain(term) for term in separation.terms)
        pairs = len(separation.pairs) // 2  # every two suspects cost as much as two alone
        more = max((starts + starts // 2) // pairs, 1)  # optima are further apart than of other criteria
        most = 40 if quick else max(16 // pairs, 8)
        starts, iterations = more if quick else 1, min(iterations, most)
    return optimise(
        holding, basis, request.duration, separation or along(rows, basis, criterion), start=start,
        seed=request.seed, starts=starts, iterations=iterations, progress=progress, stop=stop,
    )  # fmt: skip


def _expected(known: Known, planned: Any, sigma: Array, seconds: float) -> tuple[Array, float]:
    """Standard deviations (b,) after `seconds` of the motion, infinite where it does not show a parameter,
    and the condition of W with unit columns."""
    every = max(len(planned.t) // 2000, 1)
    thin = [getattr(planned, name)[::every] for name in ("q", "dq", "ddq", "sign_dq")]
    A = known.model.regressor(*thin[:3], sign=thin[3]) / sigma[:, None]
    A = A.reshape(-1, A.shape[2])
    number, weight = scaled_condition(A), seconds * ROWS_HZ / len(thin[0])
    length = np.linalg.norm(A, axis=0)
    length[length <= 1e-9 * length.max(initial=0.0)] = np.inf
    _, s, V = np.linalg.svd(A / length, full_matrices=False)
    clear = s > UNSEEN * s.max(initial=1e-300)
    shown = np.sum(V[clear] ** 2, axis=0) > 1 - 1e-6  # e_i in what the rows span
    std = np.sqrt(np.sum((V[clear] / s[clear, None]) ** 2, axis=0) / weight) / length
    return np.where(shown, std, np.inf), number if clear.all() else float("inf")


def _remarks(bounds: Bounds, known: Known, holding: Holding, motion: Planned | Recorded) -> tuple[str, ...]:
    out, designed = [], not isinstance(motion, Recorded)
    if known.assumed:
        held = " torque limits and" if designed and np.isfinite(bounds.tau).any() else ""
        out.append(
            f"{known.assumed}:{held} expected deviations hold for such a robot; --parameters FILE tells"
        )
    if isinstance(motion, Recorded):
        resting = ", ".join(bounds.labels[k] for k in motion.resting)
        told = f"{motion.file}: joint {resting} rests; record it in motion"
        return (*out, *motion.warnings, told) if resting else (*out, *motion.warnings)
    out += bounds.beyond
    if bounds.assumed:
        keys = ", ".join(bounds.assumed)
        out.append(
            f"limits of {keys} are not stated for all joints; usual ones were assumed, --limit gives them"
        )
    if not np.isfinite(bounds.tau).any():
        out.append("no torque limit is known and none was held; --limit tau:1=... gives them")
    if holding.bodies is not None and holding.bodies.left_out:
        touching = ", ".join(holding.bodies.left_out)
        out.append(f"self-collision: bodies that touch in every posture were left alone: {touching}")
    return tuple(out)
