"""How much of a hidden effect a study can show: what its own model, fitted to the runs, cannot absorb."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

import generated
from ident.twin.trajectories import Motion, State
from ident.twin.twin import ActiveEffect, Twin, run_twin
from modelgen.effects.motions import derivatives, smooth

Array = np.ndarray
RATE_HZ = 250.0
KEEP = 10  # one row in ten: the residual is looked at below 10 Hz
FILTER_S = 0.015  # Gaussian, about 10 Hz
REST = 0.01  # rad/s; a slower joint does not count, there dry friction can be anything


@dataclass(frozen=True, slots=True)
class _Run:
    label: str
    t: Array
    state: State
    rows: Array
    clean: Array  # (rows, channels) torque without the effect
    counts: Array  # (rows, channels) 1 where the channel's joint moves, else 0


class Yardstick:
    """yardstick(effect): rms share of a joint's torque that the effect adds and the model cannot absorb."""

    def __init__(self, twin: Twin, model: str, motions: Mapping[str, Motion]) -> None:
        self.twin, self.model = twin, model
        self.runs = [self._run(label, motion) for label, motion in motions.items()]
        clean = np.concatenate([run.clean for run in self.runs])
        self.rms = np.maximum(np.sqrt(np.mean(clean**2, axis=0)), 1e-3)  # N m
        kernel = generated.load(twin.source, model, exact=twin.exact)
        W = np.concatenate([kernel.regressor(*(x[run.rows] for x in run.state)) for run in self.runs])
        self.weight = np.concatenate([run.counts for run in self.runs]) / self.rms
        W *= self.weight[:, :, None]
        self.basis = np.linalg.qr(W.reshape(-1, W.shape[2]))[0]

    def _run(self, label: str, motion: Motion) -> _Run:
        t = np.arange(0.0, motion.duration, 1.0 / RATE_HZ)
        state = motion.at(t)
        rows = np.arange(KEEP, len(t) - KEEP, KEEP)
        clean = self._torque(label, t, state, ())[0][rows]
        moves = np.abs(state[1][rows]) > REST
        return _Run(label, t, state, rows, clean, np.tile(moves, clean.shape[1] // self.twin.n).astype(float))

    def _torque(
        self, label: str, t: Array, state: State, effects: tuple[ActiveEffect, ...]
    ) -> tuple[Array, Array]:
        """Filtered torque of the study's channels, and the positions that are recorded with it."""
        run = run_twin(self.twin, t, state, effects, None, label)
        if self.model == "D":
            tau = run.tau_m - run.tau_l
        else:
            names = {"A": ("tau_m",), "B": ("tau_l",), "C": ("tau_m", "tau_l")}[self.model]
            tau = np.concatenate([getattr(run, name) for name in names], axis=1)
        return smooth(tau, 1.0 / RATE_HZ, FILTER_S), run.q

    def __call__(self, effect: ActiveEffect) -> float:
        """Of the effect's joint, or of the joint that shows it most; over the runs in which it acts."""
        parts, acts = [], []
        for run in self.runs:
            tau, q = self._torque(run.label, run.t, run.state, (effect,))
            clean = run.clean
            if not np.array_equal(q, run.state[0]):  # the encoder saw another motion than the link made
                seen = (q, *derivatives(q, 1.0 / RATE_HZ))
                clean = self._torque(run.label, run.t, seen, ())[0][run.rows]
            parts.append(tau[run.rows] - clean)
            acts.append(np.full(len(run.rows), effect.acts_in(run.label)))
        added = np.concatenate(parts) * self.weight
        flat = added.reshape(-1)
        left = (flat - self.basis @ (self.basis.T @ flat)).reshape(added.shape)
        inside = np.concatenate(acts)
        share = np.sqrt(np.mean(left[inside] ** 2, axis=0)) if inside.any() else np.zeros(left.shape[1])
        joint = effect.request.joint
        return float(share.max() if joint is None else share[joint :: self.twin.n].max())
