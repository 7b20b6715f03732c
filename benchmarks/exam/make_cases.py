"""Write exam cases: folders with a study and recordings, and the truth in a folder apart.

    python benchmarks/exam/make_cases.py --seed 1 --out /tmp/exam --kinds single clean --per-effect 2

DIR/cases/<case>/{study.yaml, run*.parquet, robot.yaml} is all that the program under examination may see;
DIR/truth/<case>.json says what was put in and what a fit that knows it reaches.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import yaml

from benchmarks.exam import draw, motion, physics, robots, yardstick
from benchmarks.exam.physics import Drives, Injected, Plant, Run

KINDS = ("single", "clean", "pair", "outside", "weak", "noisy", "twice")
WITHOUT_EFFECTS = tuple(f"without:{name}" for name in draw.PAPER)


def _coloured(shape: tuple[int, int], rate: float, corner_hz: float, rng: np.random.Generator) -> np.ndarray:
    """Unit-variance first-order noise."""
    from scipy.signal import lfilter

    a = np.exp(-2 * np.pi * corner_hz / rate)
    white = rng.normal(size=(shape[0] + 2000, shape[1]))
    return lfilter([np.sqrt(1 - a * a)], [1, -a], white, axis=0)[2000:]


def _motion(
    robot: robots.ExamRobot, rate: float, seconds: float, pace: float, kind: str, rng: np.random.Generator
) -> tuple[np.ndarray, ...]:
    t = np.arange(round(seconds * rate) + 1) / rate
    slides = np.array([row.prismatic for row in robot.rows])
    speed = np.where(slides, 0.25, pace) * rng.uniform(0.7, 1.2, robot.n)
    reach = np.where(slides, 0.2, 2.0) * rng.uniform(0.6, 1.0, robot.n)
    shape = motion.fourier if kind == "fourier" else motion.point_to_point
    return (t, *shape(t, speed, reach, rng))


def _drives(runs: list[Run], model: str, dwells: bool, rng: np.random.Generator) -> Drives:
    tau = np.vstack([r.tau for r in runs])
    dq, ddq = np.vstack([r.dq for r in runs]), np.vstack([r.ddq for r in runs])
    n = tau.shape[1]
    S = np.sqrt(np.mean(tau**2, axis=0))
    S = np.maximum(S, 0.02 * S.max())
    v, a = np.sqrt(np.mean(dq**2, axis=0)), np.sqrt(np.mean(ddq**2, axis=0))
    small = 1.0 if model == "A" else 0.25
    dahl = rng.random() < 0.25 and not dwells  # at rest Dahl friction stays: no small deviation from a sign
    return Drives(
        Ia=S / a * rng.uniform(0.05, 0.5, n),
        Fv=S / v * rng.uniform(0.08, 0.4, n),
        Fc=S * rng.uniform(0.05, 0.35, n),
        off=S * rng.uniform(-0.05, 0.05, n),
        Fvl=S / v * small * rng.uniform(0.05, 0.3, n),
        Fcl=S * small * rng.uniform(0.05, 0.3, n),
        offl=S * rng.uniform(-0.03, 0.03, n),
        presliding=rng.uniform(3e-6, 3e-5, n) if dahl else np.zeros(n),
        smooth=np.exp(rng.uniform(np.log(3e-4), np.log(1e-2), n)),
    )


class Case:
    """One drawn case, from robot to truth."""

    def __init__(
        self, kind: str, effects: list[str], seed: int, seconds: float, rate: float | None, model: str
    ):
        self.kind, self.names, self.seed = kind, effects, seed
        rng = self.rng = np.random.default_rng(seed)
        pool = [*robots.BUILTIN, *robots.BUILTIN, *(robots.random_robot(k) for k in range(6))]
        self.robot = pool[int(rng.integers(len(pool)))]
        self.rate = rate or float(rng.choice([1000, 1000, 1000, 500, 250]))
        drawn_model = str(rng.choice(["A", "B", "C", "D"], p=[0.55, 0.2, 0.21, 0.04]))
        if "sensor_crosstalk" in effects:
            drawn_model = str(rng.choice(["B", "C"]))
        elif (
            (
                drawn_model == "D"
                and set(effects) & {"payload_change", "external_force", "base_tilt", "backlash"}
            )
            or (any(e.startswith("without") for e in effects) and drawn_model in "CD")
            or "without:rotor_inertia" in effects
        ):
            drawn_model = "A"
        if drawn_model == "D" and "joint_elasticity" in effects:
            drawn_model = "A"
        self.model = model or drawn_model
        self.without = tuple(e.split(":")[1] for e in effects if e.startswith("without:"))
        self.layout = yardstick.Layout(self.model, self.without)
        self.uses = [
            ["identify", "identify", "validate"],
            ["identify", "validate"],
            ["identify", "identify"],
        ][int(rng.choice(3, p=[0.6, 0.25, 0.15]))]
        style = str(rng.choice(["fourier", "fourier", "fourier", "moves"]))
        pace = float(rng.uniform(0.5, 2.0))
        model_links = robots.random_links(self.robot, rng)
        pin_model = robots.pinocchio_model(self.robot, model_links)
        self.runs = []
        for k in range(len(self.uses)):
            t, q, dq, ddq = _motion(self.robot, self.rate, seconds, pace, style, rng)
            self.runs.append(Run(t, q, dq, ddq, robots.inverse_dynamics(pin_model, q, dq, ddq), k))
        self.plant = Plant(
            self.robot,
            pin_model,
            model_links,
            _drives(self.runs, self.model, style == "moves", rng),
            self.model != "A",
        )
        self.noise_scale = 3.0 if kind == "noisy" else 1.0
        self.encoder = float(rng.uniform(2e-5, 1e-4))
        self.identify = [k for k, use in enumerate(self.uses) if use == "identify"]
        self._effect_free()

    # --- the recording without effects
    def _effect_free(self) -> None:
        rng = self.rng
        self.free = [physics.simulate(self.plant, run, []) for run in self.runs]
        n = self.robot.n
        rms_m = np.sqrt(np.mean([np.mean(f[1] ** 2, axis=0) for f in self.free], axis=0))
        rms_l = np.sqrt(np.mean([np.mean(f[2] ** 2, axis=0) for f in self.free], axis=0))
        white, colour = rng.uniform(0.5, 1.5, n) / 100, rng.uniform(0.6, 1.1, n) / 100
        corner = float(rng.uniform(0.7, 6.0))
        self.noise = []
        for run in self.runs:
            shape = (len(run.t), n)
            parts = [
                self.noise_scale
                * rms
                * (white * rng.normal(size=shape) + colour * _coloured(shape, self.rate, corner, rng))
                for rms in (rms_m, rms_l)
            ]
            self.noise.append(parts)
        self.dither = [rng.uniform(-0.5, 0.5, (1, n)) * self.encoder for _ in self.runs]
        Y = [self._kept(k, self.free[k]) for k in range(len(self.runs))]
        self.size = np.sqrt(np.mean(np.vstack([Y[k] for k in self.identify]) ** 2, axis=0))
        self.weight = 1.0 / (0.01 * np.maximum(self.size, 1e-3 * self.size.max()))
        self.W = [self._columns(k, self.free[k][0]) for k in range(len(self.runs))]
        stack = np.concatenate([self.W[k] for k in self.identify])
        self.base = yardstick.base_columns(stack)
        self.W = [w[:, :, self.base] for w in self.W]
        self.yard = yardstick.Yardstick.of(stack[:, :, self.base], self.weight)
        self.clean_error = self.yard.error_percent(np.vstack([Y[k] for k in self.identify]))
        if self.clean_error.max() > 3.0 * self.noise_scale and not self.without:
            raise RuntimeError("slow motion of a light joint: the rigid fit itself is poor")
        channels = self.size.reshape(-1, n)
        torque = channels[1] if self.model == "C" and len(channels) > 1 else channels[0]
        self.scene = draw.Scene(self.plant, self.runs, self.model, torque, len(self.identify))

    def _record(self, k: int, signals: tuple[np.ndarray, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Measured position and torques of run k."""
        q, tau_m, tau_l = signals
        e = self.encoder
        return np.round((q + self.dither[k]) / e) * e, tau_m + self.noise[k][0], tau_l + self.noise[k][1]

    def _columns(self, k: int, motor_q: np.ndarray, link_q: np.ndarray | None = None) -> np.ndarray:
        e = self.encoder
        q = np.round((motor_q + self.dither[k]) / e) * e
        link = None if link_q is None else q + (link_q - motor_q)
        return yardstick.columns(self.plant.model, self.layout, self.rate, q, link)

    def _kept(self, k: int, signals: tuple[np.ndarray, ...]) -> np.ndarray:
        _, tau_m, tau_l = self._record(k, signals)
        return self._seen(tau_m, tau_l)

    def _seen(self, tau_m: np.ndarray, tau_l: np.ndarray) -> np.ndarray:
        """Of torques at the rate of a run the rows that are compared, filtered."""
        Y = yardstick.smooth(yardstick.measured_torque(self.layout, tau_m, tau_l), self.rate)
        return Y[yardstick.kept_rows(len(Y), self.rate)]

    def _noise_percent(self, signals: Sequence[tuple[np.ndarray, ...]]) -> np.ndarray:
        """(channels,) the noise that was put into the fitted runs, of their torque, both filtered."""
        noise, torque = (
            np.vstack(its)
            for its in zip(*((self._seen(*self.noise[k]), self._kept(k, signals[k])) for k in self.identify))
        )
        return np.asarray(100 * np.linalg.norm(noise, axis=0) / np.linalg.norm(torque, axis=0))

    # --- effects
    def _with(self, effects: list[Injected]) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        return [physics.simulate(self.plant, run, effects) for run in self.runs]

    def _rigid_error(self, signals: Sequence[tuple[np.ndarray, ...]], moved: bool) -> np.ndarray:
        yard = self.yard
        if moved:
            W = np.concatenate([self._columns(k, signals[k][0])[:, :, self.base] for k in self.identify])
            yard = yardstick.Yardstick.of(W, self.weight)
        return yard.error_percent(np.vstack([self._kept(k, signals[k]) for k in self.identify]))

    def _channels_of(self, effect: Injected) -> np.ndarray:
        """Channels on which the effect must show (all when it has no joint of its own)."""
        n = self.robot.n
        if effect.joint is None:
            return np.arange(len(self.size))
        if self.model == "C":
            return np.array([effect.joint + (n if effect.side == "sensor" else 0)])
        return np.array([effect.joint])

    def place(
        self, name: str, taken: set[int], target: float, beside: Injected | None = None
    ) -> Injected | None:
        """Draw joint and size of one effect until its joint's error comes to the target percentage; beside
        one of the same name, on its joint."""
        rng = self.rng
        n = self.robot.n
        sharp = [j for j in range(n) if j not in taken and self.clean_error[j] < 2.0 * self.noise_scale]
        for _ in range(8):
            joint = int(rng.choice(sharp or [j for j in range(n) if j not in taken]))
            if beside is not None and beside.joint is not None:
                joint = beside.joint
            if name == "joint_elasticity":
                self.plant.drives.Fcl[joint] = 0.0
            drawn = draw.draw(name, self.scene, joint, rng)
            if drawn is None:
                continue
            a = min(max(drawn.start, drawn.low), drawn.high)
            if beside is not None and not draw.another(beside, drawn.build(a)):
                continue
            shows = self._channels_of(drawn.build(a))
            free = (
                [physics.simulate(self.plant, r, []) for r in self.runs]
                if name == "joint_elasticity"
                else None
            )
            clean = self._rigid_error(free, False) if free else self.clean_error
            wanted = np.sqrt(max(target**2 - float(clean[shows].max()) ** 2, 0.25))
            for turn in range(5):
                effect = drawn.build(a)
                error = self._rigid_error(self._with([effect]), name == "joint_elasticity")
                worst = shows[int(np.argmax(error[shows] / clean[shows]))]
                extra = np.sqrt(max(error[worst] ** 2 - clean[worst] ** 2, 1e-6))
                if abs(extra / wanted - 1) < 0.15 or turn == 4:
                    break
                a_new = min(max(a * float(np.clip(wanted / extra, 0.1, 10)), drawn.low), drawn.high)
                if a_new == a:
                    break
                a = a_new
            if error[worst] >= 1.3 * clean[worst] and 1.3 <= error[worst] <= 22:
                if self.kind == "weak":
                    effect = drawn.build(0.4 * a)
                return effect
        return None

    def leave_out(self, name: str, target: float) -> list[Injected]:
        """The paper's own term, present in the robot, absent in the study: on one joint or on all."""
        d, n, rng = self.plant.drives, self.robot.n, self.rng
        fields = {"coulomb_friction": ("Fc", "Fcl"), "viscous_friction": ("Fv", "Fvl")}
        fields |= {"offset": ("off", "offl"), "rotor_inertia": ("Ia",)}
        key = {"coulomb_friction": "Fc", "viscous_friction": "Fv", "offset": "off", "rotor_inertia": "Ia"}[
            name
        ]
        alone = rng.random() < 0.6
        for _ in range(8):
            joint = int(rng.integers(n))
            before = {f: getattr(d, f).copy() for f in fields[name]}
            if alone:
                for f in fields[name]:
                    setattr(d, f, np.where(np.arange(n) == joint, before[f], 0.0))
            scale, n_tries = 1.0, 4
            unit = {f: getattr(d, f).copy() for f in fields[name]}
            for _ in range(n_tries):
                for f in fields[name]:
                    setattr(d, f, unit[f] * scale)
                error = self._rigid_error(self._with([]), False)
                own = error if not alone else error[joint : joint + 1]
                top = float(own.max())
                if top > 1.3 and abs(top / target - 1) < 0.2:
                    break
                scale *= float(np.clip(target / max(top, 0.3), 0.2, 4))
            if 1.4 <= top <= 25:
                side = "link" if self.model == "B" else "motor"
                out = []
                for j in range(n):
                    value = getattr(d, fields[name][1 if self.model == "B" and len(fields[name]) > 1 else 0])[
                        j
                    ]
                    if value:
                        out.append(Injected(name, j, {key: float(value)}, side))
                if out:
                    self.free = self._with([])
                    self.clean_error = self._rigid_error(self.free, False)  # what comes beside it has to show
                    return sorted(out, key=lambda e: -error[e.joint])
            for f in fields[name]:
                setattr(d, f, before[f])
        return []

    # --- the fit that knows
    def oracle(self, effects: list[Injected], signals: Sequence[tuple[np.ndarray, ...]]) -> dict[str, object]:
        """Errors of the rigid model and of the rigid model plus the true terms, identify and validate."""
        full = yardstick.Layout(self.model, ())
        elastic = [e for e in effects if e.name == "joint_elasticity"]
        Y = [self._kept(k, signals[k]) for k in range(len(self.runs))]
        motor = [s[0] for s in signals]
        rigid = [self._columns(k, motor[k]) if elastic else self.W[k] for k in range(len(self.runs))]
        known, terms = [], []
        rest = [e for e in effects if e.name not in ("joint_elasticity", *draw.PAPER)]
        without = physics.simulate
        for k, run in enumerate(self.runs):
            q = np.round((motor[k] + self.dither[k]) / self.encoder) * self.encoder
            link = q + (run.q - motor[k]) if elastic else None
            known.append(yardstick.columns(self.plant.model, full, self.rate, q, link))
            each = []
            for e in rest:
                others = [o for o in effects if o is not e and o.name not in draw.PAPER]
                off = without(self.plant, run, others)
                a = yardstick.measured_torque(self.layout, signals[k][1], signals[k][2])
                b = yardstick.measured_torque(self.layout, off[1], off[2])
                delta = yardstick.smooth(a - b, self.rate)
                each.append(delta[yardstick.kept_rows(len(delta), self.rate)])
            terms.append(each)
        out: dict[str, object] = {}
        extended = []
        for k in range(len(self.runs)):
            extra = [d[:, :, None] for d in terms[k]]
            extended.append(np.concatenate([known[k], *extra], axis=2) if extra else known[k])
        for label, W in (("rigid", rigid), ("true", extended)):
            WI = np.concatenate([W[k] for k in self.identify])
            YI = np.concatenate([Y[k] for k in self.identify])
            for role in ("identify", "validate"):
                which = [k for k, use in enumerate(self.uses) if use == role]
                if not which:
                    continue
                Wr = np.concatenate([W[k] for k in which])
                Yr = np.concatenate([Y[k] for k in which])
                rho = Yr - yardstick.predict(WI, YI, self.weight, Wr)
                out[f"{label}_{role}_percent"] = (
                    100 * np.linalg.norm(rho, axis=0) / np.linalg.norm(Yr, axis=0)
                ).tolist()
                out[f"{label}_{role}_total_percent"] = float(100 * np.linalg.norm(rho) / np.linalg.norm(Yr))
        return out

    # --- files
    def write(self, case: str, out: Path) -> dict[str, Any]:
        rng, n = self.rng, self.robot.n
        target = float(np.exp(rng.uniform(np.log(1.8), np.log(14.0))))
        if self.kind == "noisy":
            target = float(np.exp(rng.uniform(np.log(4.0), np.log(16.0))))
        effects: list[Injected] = []
        taken: set[int] = set()
        for name in self.names:
            if name.startswith("without:"):
                placed = self.leave_out(name.split(":")[1], target)
                if not placed:
                    raise RuntimeError(f"{name} could not be placed")
                effects += placed
            else:
                beside = effects[0] if self.kind == "twice" and effects else None
                one = self.place(name, taken, target, beside)
                if one is None:
                    raise RuntimeError(f"{name} could not be placed")
                effects.append(one)
                if one.joint is not None:
                    taken.add(one.joint)
        if len(self.names) == 2:
            effects.sort(key=lambda e: e.name not in draw.PAPER)
        physical = [e for e in effects if e.name not in draw.PAPER]
        signals = self._with(physical)
        error = self._rigid_error(signals, any(e.name == "joint_elasticity" for e in effects))
        folder = out / "cases" / case
        folder.mkdir(parents=True, exist_ok=True)
        currents = self.model == "A" and rng.random() < 0.15
        jitter = float(rng.choice([0.0, 0.0, 2e-5, 1e-4])) * min(1.0, 500 / self.rate)
        gains = np.round(rng.uniform(0.5, 20, n), 3)
        study: dict[str, Any] = {
            "robot": self.robot.name if self.robot.builtin else "robot.yaml",
            "model": self.model,
            "recordings": [],
        }
        if not self.robot.builtin:
            robots.write_robot_file(self.robot, folder / "robot.yaml")
        for k, run in enumerate(self.runs):
            q, tau_m, tau_l = self._record(k, signals[k])
            stamps = run.t + (rng.normal(0, jitter, len(run.t)) if jitter else 0.0)
            stamps = np.maximum.accumulate(stamps) + 1e-9 * np.arange(len(stamps))
            table = {"t": stamps} | {f"q{j + 1}": q[:, j] for j in range(n)}
            if self.model != "B":
                label, scale = ("i", 1 / gains) if currents else ("tau_m", np.ones(n))
                table |= {f"{label}{j + 1}": tau_m[:, j] * scale[j] for j in range(n)}
            if self.model != "A":
                table |= {f"tau_l{j + 1}": tau_l[:, j] for j in range(n)}
            pq.write_table(pa.table(table), folder / f"run{k + 1}.parquet", compression="lz4")
            study["recordings"].append({"file": f"run{k + 1}.parquet", "use": self.uses[k]})
        if currents:
            study["drive_gains"] = [float(g) for g in gains]
        if self.without:
            study["without"] = list(self.without)
        if rng.random() < 0.5:
            study["filter"] = {"position_cutoff_hz": 10}
        (folder / "study.yaml").write_text(yaml.safe_dump(study, sort_keys=False))
        truth = {
            "case": case,
            "kind": self.kind,
            "names": self.names,
            "seed": self.seed,
            "robot": self.robot.name,
            "n": n,
            "model": self.model,
            "rate": self.rate,
            "uses": self.uses,
            "without": list(self.without),
            "effects": [
                {
                    "effect": e.name,
                    "joints": [] if e.joint is None else [e.joint + 1],
                    "side": e.side,
                    "source_joint": None if e.source is None else e.source + 1,
                    "recording": None if e.run is None else f"run{e.run + 1}.parquet",
                    "parameters": {k: float(v) for k, v in e.params.items()},
                    "listed": e.listed,
                    "depends_on": list(e.depends_on),
                }
                for e in effects
            ],
            "clean_percent": self.clean_error.tolist(),
            "rigid_percent": error.tolist(),
            "noise_percent": self._noise_percent(signals).tolist(),
            "oracle": self.oracle(effects, signals),
        }
        (out / "truth").mkdir(parents=True, exist_ok=True)
        (out / "truth" / f"{case}.json").write_text(json.dumps(truth, indent=1))
        return truth


def _seed(*parts: object) -> int:
    return zlib.crc32("/".join(map(str, parts)).encode())


def plan(seed: int, kinds: list[str], effects: list[str] | None, per_effect: int, clean: int, pairs: int):
    """(kind, effect names, seed) of every case asked for, in an order that does not tell the effect."""
    listed = [*draw.CATALOGUE, *WITHOUT_EFFECTS]
    wanted = effects or listed
    todo: list[tuple[str, list[str], int]] = []
    for kind in kinds:
        if kind == "clean":
            todo += [("clean", [], _seed(seed, kind, k)) for k in range(clean)]
        elif kind == "pair":
            for k in range(pairs):
                rng = np.random.default_rng(_seed(seed, "pair", k))
                todo.append(
                    (kind, [str(x) for x in rng.choice(wanted, 2, replace=False)], _seed(seed, kind, k))
                )
        elif kind == "twice":
            names = [name for name in effects or draw.SEVERAL if name in draw.SEVERAL]
            todo += [
                (kind, [name, name], _seed(seed, kind, name, k)) for k in range(per_effect) for name in names
            ]
        else:
            names = list(draw.OUTSIDE) if kind == "outside" and not effects else wanted
            todo += [(kind, [name], _seed(seed, kind, name, k)) for k in range(per_effect) for name in names]
    return todo


def make_case(
    kind: str,
    names: list[str],
    seed: int,
    case: str,
    out: Path,
    seconds: float,
    rate: float | None,
    model: str,
) -> dict[str, Any] | None:
    """Write one case; a draw in which the effect cannot show is drawn again (up to 5 times)."""
    for turn in range(5):
        try:
            return Case(kind, names, seed + 7919 * turn, seconds, rate, model).write(case, out)
        except RuntimeError:
            continue
    return None


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=["single", "clean"])
    parser.add_argument("--effects", nargs="+")
    parser.add_argument("--per-effect", type=int, default=1)
    parser.add_argument("--clean", type=int, default=5)
    parser.add_argument("--pairs", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--hz", type=float)
    parser.add_argument("--model", default="")
    arguments = parser.parse_args()
    a = arguments
    for k, (kind, names, seed) in enumerate(plan(a.seed, a.kinds, a.effects, a.per_effect, a.clean, a.pairs)):
        case = f"s{a.seed}_{kind[0]}{k:03d}"
        if (a.out / "truth" / f"{case}.json").exists():
            continue
        begin = time.perf_counter()
        truth = make_case(kind, names, seed, case, a.out, a.seconds, a.hz, a.model)
        took = time.perf_counter() - begin
        if truth is None:
            print(f"{case} {'+'.join(names)}: could not be placed ({took:.1f} s)", flush=True)
            continue
        what = " ".join(f"{e['effect']}:{e['joints']}" for e in truth["effects"]) or "clean"
        rigid = " ".join(f"{x:.1f}" for x in truth["rigid_percent"])
        print(f"{case} {truth['robot']} {truth['model']} {what} rigid {rigid} ({took:.1f} s)", flush=True)


if __name__ == "__main__":
    main()
