"""How often the 95 % intervals of `ident fit` hold the true value, on twins with coloured torque noise.

    python benchmarks/interval_coverage.py [--model C] [--motions 5] [--draws 10] [--correlation 0.01]

Every motion is a fresh pair of 90 s point-to-point runs, without and with the payload; every draw is fresh
noise on it. Columns of W do not depend on the noise of the torques, so they are decimated once a motion, and
every draw runs through the whole of estimation, reduction and covariance as in `ident fit`.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ident.equations.build import observe
from ident.equations.columns import Columns
from ident.equations.observation import ChannelFactor, RecordingSystem, triangular
from ident.equations.prepared import prepare_study
from ident.estimation.least_squares import Estimate
from ident.estimation.noise import channel_noises, honest_covariance
from ident.estimation.reduction import reduce
from ident.estimation.solving import estimate_all
from ident.recordings.study import load_study
from ident.signals.decimation import decimate
from ident.twin.sensors import Sensors, coloured_noise, noise_level
from ident.twin.study import PlannedRun, simulate
from ident.twin.writing import write_simulation

RUNS = (PlannedRun("run1", "identify", 90.0, 44), PlannedRun("run5", "identify", 90.0, 44, loaded=True))


@dataclass
class Tally:
    """Counts over all draws: intervals that hold the truth, by kind."""

    inside: int = 0
    total: int = 0

    def add(self, hits: np.ndarray) -> None:
        self.inside += int(hits.sum())
        self.total += hits.size

    @property
    def percent(self) -> float:
        return 100 * self.inside / max(self.total, 1)


def with_noise(system: RecordingSystem, noise: list[np.ndarray]) -> RecordingSystem:
    """The same equations with decimated noise (channels, m) added to Y of each segment."""
    segments = tuple(replace(segment, Y=segment.Y + extra) for segment, extra in zip(system.segments, noise))
    factors = []
    for j, factor in enumerate(system.factors):
        mine = system.channel == j
        order = np.argsort(system.column[mine], kind="stable")
        rows = np.vstack([np.column_stack([s.values[mine][order].T, s.Y[j]]) for s in segments])
        factors.append(ChannelFactor(factor.columns, triangular(rows), factor.rows))
    return replace(system, factors=tuple(factors), segments=segments)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--model", default="C")
    parser.add_argument("--motions", type=int, default=5)
    parser.add_argument("--draws", type=int, default=10)
    parser.add_argument("--correlation", type=float, default=0.01, help="time constant of the AR(1) noise, s")
    parser.add_argument("--noise", type=float, default=1.0, help="percent of each channel's rms")
    parser.add_argument("--cutoff", type=float, default=0.8)
    parser.add_argument("--sign-velocity", type=float, default=None, help="as in a study's filter")
    parser.add_argument("--list", action="store_true", help="coverage of each parameter")
    parser.add_argument(
        "--paper", action="store_true", help="the paper's F-test, all rows taken as independent"
    )
    chosen = parser.parse_args()
    sensors = Sensors(noise_correlation_s=chosen.correlation, noise_percent=chosen.noise)
    silent = replace(sensors, noise_percent=0.0, noise_floor=0.0)
    tallies = {
        kind: Tally()
        for kind in (
            "full honest",
            "full white",
            "essential honest",
            "essential white",
            "nonzero essential honest",
            "essential chi, full std",
            "nonzero essential chi, full std",
        )
    }
    each: dict[str, list[float]] = {}
    errors_mass = []
    for motion in range(chosen.motions):
        simulated = simulate(
            "kuka_lwr4p", chosen.model, payload_kg=4.6136, seed=motion, sensors=silent, runs=RUNS
        )
        with tempfile.TemporaryDirectory() as folder:
            study = load_study(write_simulation(simulated, Path(folder)))
            settings = study.filter.model_copy(
                update={"decimation_cutoff_hz": chosen.cutoff, "sign_velocity": chosen.sign_velocity}
            )
            prepared = prepare_study(study.with_(filter=settings))
            clean = [
                observe(stream, bank, prepared.columns, chosen.cutoff)
                for stream, bank in zip(prepared.streams, prepared.banks)
            ]
            levels = [noise_level(stream_torque(s), sensors) for s in simulated.recordings]
        truth = true_chi(prepared.columns, simulated.truth)
        rng = np.random.default_rng([motion, 99])
        for _ in range(chosen.draws):
            noisy = []
            for stream, system, level in zip(prepared.streams, clean, levels):
                samples = system.samples
                noise = coloured_noise((samples, len(level)), sensors, rng) * level
                if chosen.model == "D":
                    noise = noise[:, : noise.shape[1] // 2] - noise[:, noise.shape[1] // 2 :]
                noisy.append(with_noise(system, [decimate(noise, stream.rate_hz, chosen.cutoff).T]))
            full, _ = estimate_all(noisy, study, prepared.columns)
            noises = channel_noises(noisy, full)
            share = 1.0
            if not chosen.paper:
                share = min(1.0, sum(n.effective_rows for n in noises) / full.rows)
            essential = reduce(full, study.reduction_alpha, share).estimate
            score(full, noisy, truth, tallies, "full", {})
            score(essential, noisy, truth, tallies, "essential", each)
            wide = np.sqrt(np.diag(honest_covariance(noisy, full, noises)))
            k = np.flatnonzero(essential.active)
            z = np.abs(essential.chi[k] - truth[k]) / wide[k]
            tallies["essential chi, full std"].add(z < 1.96)
            tallies["nonzero essential chi, full std"].add(z[truth[k] != 0] < 1.96)
            if "ML" in full.parameters:
                k = full.parameters.index("ML")
                errors_mass.append(100 * (essential.chi[k] / truth[k] - 1))
        print(
            f"motion {motion + 1}: b = {full.b}, essential {essential.b}, "
            f"condition {full.condition_number:.0f}, "
            f"rows {full.rows}, " + ", ".join(f"{k} {t.percent:.1f}" for k, t in tallies.items()),
            flush=True,
        )
    if errors_mass:
        print(f"payload mass: largest error {np.abs(errors_mass).max():.3g} %")
    if chosen.list:
        for name, hits in sorted(each.items(), key=lambda item: np.mean(item[1])):
            z = np.array(hits)
            print(
                f"{name:8} inside {100 * np.mean(np.abs(z) < 1.96):5.1f} % of {len(z):3d}  "
                f"mean z {z.mean():+.2f}  "
                f"std z {z.std():.2f}"
            )


def stream_torque(recording: object) -> np.ndarray:
    columns = recording.columns  # type: ignore[attr-defined]
    return np.column_stack([value for name, value in columns.items() if name.startswith("tau")])


def true_chi(columns: Columns, truth: dict) -> np.ndarray:
    """True values of the study's parameters."""
    model = columns.model
    standard = truth["standard_parameters"] | {
        f"{name}L": value for name, value in (truth["payload"] or {}).items()
    }
    chi = model.regroup(
        {name: value for name, value in standard.items() if name in model.standard_parameters}
    )
    known = dict(zip(model.parameters, chi))
    return np.array([known[name] for name in columns.parameters])


def score(
    estimate: Estimate,
    systems: list[RecordingSystem],
    truth: np.ndarray,
    tallies: dict[str, Tally],
    kind: str,
    each: dict[str, list[float]],
) -> None:
    covariance = honest_covariance(systems, estimate, channel_noises(systems, estimate))
    k = np.flatnonzero(estimate.active)
    error = estimate.chi[k] - truth[k]
    z = error / np.sqrt(np.diag(covariance))[k]
    tallies[f"{kind} honest"].add(np.abs(z) < 1.96)
    tallies[f"{kind} white"].add(np.abs(error / estimate.std[k]) < 1.96)
    if kind == "essential":
        tallies["nonzero essential honest"].add(np.abs(z[truth[k] != 0]) < 1.96)
        for i, value in zip(k, z):
            each.setdefault(estimate.parameters[i], []).append(float(value))


if __name__ == "__main__":
    main()
