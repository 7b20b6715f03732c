"""A fit kept for later: `fit.npz` beside fit.json, all that export and prediction need, without recordings.
A diagnosis keeps that of the extended model.

`keep` writes it, `load_fit` reads it back and checks that fit.json, fit.npz and the robot file still belong
together. Held are: the parameters (essential and full) with the honest covariance, one triangular factor of
[W Y] per channel and role, the weighted factor of the fit, sigma and the autoregressive noise, the decimated
residuals, the study with absolute paths, and the robot file's text. The compiled model is loaded from that
text, so a fit's folder can be moved, and its robot file be changed, without harm.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ident.equations.columns import Columns
from ident.equations.observation import ChannelFactor, stack
from ident.equations.prepared import columns_of, travel_seen
from ident.errors import IdentError
from ident.estimation.fit import FitResult
from ident.estimation.noise import ChannelNoise
from ident.recordings.study import Study, study_from

if TYPE_CHECKING:
    from ident.equations.comparison import Fitted
    from ident.equations.terms import Term
    from modelgen.geometry.robot import Robot

TextTable = tuple[tuple[str, ...], list[tuple[str, ...]]]  # header, rows

FILE = "fit.npz"
FORMAT = 2
CERTAIN = 0.95  # probability of the band that `spread` is the half width of


class SavedFitError(IdentError):
    """A fit's files that are missing, foreign or do not belong together: which one, and the remedy."""


@dataclass(frozen=True, slots=True)
class Residuals:
    """Decimated residuals of one segment: rho (channels, m) in N m, used (channels, m) rows that count."""

    label: str
    role: str
    t: np.ndarray
    rho: np.ndarray
    used: np.ndarray


@dataclass(frozen=True, slots=True)
class SavedFit:
    """A fit read back. Arrays are over the b parameters of `columns`; factors are unweighted, N m."""

    folder: Path
    document: Mapping[str, Any]  # fit.json
    study: Study
    columns: Columns  # with the parameters of `terms`
    rigid: Columns  # without
    terms: tuple[Term, ...]  # the study's effects where the fit has them
    robot: str  # path of the robot file as it was
    chi: np.ndarray  # (b,) essential ones, zero elsewhere
    active: np.ndarray  # (b,) bool: essential
    full_chi: np.ndarray
    full_active: np.ndarray  # (b,) bool: excited by the identify runs
    covariance: np.ndarray  # (b, b) honest, of the full model
    R: np.ndarray  # (b + 1, b + 1) weighted factor of [W Y], identify runs
    rss: float  # weighted, of chi
    rows: int
    effective_rows: float
    sigma: np.ndarray  # (channels,) N m
    noises: tuple[ChannelNoise, ...]
    factors: dict[str, tuple[ChannelFactor, ...]]  # role -> one per channel
    cutoff_hz: float
    residuals: tuple[Residuals, ...]
    spread: np.ndarray  # (channels,) N m: 95 % of the full-rate errors of identify and validate lie within

    @property
    def share(self) -> float:
        """Effective rows over rows, at most 1."""
        return min(1.0, self.effective_rows / max(self.rows, 1))

    def load_robot(self) -> Robot:
        """The robot as it was, with the study's gravity."""
        from modelgen.geometry.robot_file import load_robot

        robot = load_robot(self.robot, self.study.exact)
        return robot if self.study.gravity is None else robot.with_gravity(self.study.gravity)

    def fitted(self, vs: Mapping[str, np.ndarray]) -> Fitted:
        """The estimate with its effects, for recordings whose signs are certain from `vs` on."""
        from ident.equations.comparison import Fitted
        from ident.equations.fitted import FittedModel

        chi = self.chi[: len(self.rigid.parameters)]
        model = FittedModel(self.rigid, self.load_robot(), chi, vs) if self.terms else None
        return Fitted(model, self.chi, self.terms)

    def error_percent(self, chi: np.ndarray, role: str) -> dict[str, float]:
        """100 ||Y - W chi|| / ||Y|| of the rows that count, per channel and in all ("total")."""
        above = np.array([factor.sum_of_squares(chi) for factor in self.factors[role]])
        below = np.array([np.sum(factor.R[:, -1] ** 2) for factor in self.factors[role]])
        out = {"total": float(100 * np.sqrt(above.sum() / max(below.sum(), 1e-300)))}
        each = 100 * np.sqrt(above / np.maximum(below, 1e-300))
        return out | {name: float(value) for name, value in zip(self.columns.channels, each)}


def keep(result: FitResult, folder: Path) -> None:
    """Write `fit.npz` of a fit into `folder`, beside its fit.json."""
    study, estimate = result.study, result.estimate
    robot, text = _robot_text(study.robot_source)
    factors: dict[str, np.ndarray] = {}
    roles = tuple(dict.fromkeys(system.role for system in result.systems))
    for role in roles:
        for j, factor in enumerate(stack([system for system in result.systems if system.role == role])):
            factors |= {
                f"R_{role}_{j}": factor.R,
                f"columns_{role}_{j}": factor.columns,
                f"rows_{role}_{j}": np.array(factor.rows),
            }
    pieces: dict[str, np.ndarray] = {}
    labels: list[tuple[str, str]] = []
    for system in result.systems:
        for segment, rho in zip(system.segments, system.residuals(estimate.chi)):
            k = len(labels)
            labels.append((system.label, system.role))
            pieces |= {f"t_{k}": segment.t, f"rho_{k}": rho.astype(np.float32), f"used_{k}": segment.used}
    for j, noise in enumerate(result.noises):
        pieces |= {f"ar_{j}": noise.coefficients, f"correlation_{j}": noise.autocorrelation}
    about = {
        "format": FORMAT,
        "robot": robot,
        "robot_sha256": hashlib.sha256(text).hexdigest(),
        "study": _portable(result),
        "parameters": list(result.columns.parameters),
        "channels": list(result.columns.channels),
        "travel": list(travel_seen(result.recordings)),
        "roles": roles,
        "segments": labels,
        "cutoff_hz": result.cutoff_hz,
        "rss": estimate.rss,
        "rows": estimate.rows,
        "effective_rows": result.effective_rows,
        "noise_rows": [noise.rows for noise in result.noises],
    }
    np.savez_compressed(
        folder / FILE,
        about=np.array(json.dumps(about)),
        robot=np.frombuffer(text, np.uint8),
        chi=estimate.chi,
        active=estimate.active,
        full_chi=result.full.chi,
        full_active=result.full.active,
        covariance=result.full_covariance,
        R=estimate.R,
        sigma=estimate.sigma,
        variance=np.array([noise.variance for noise in result.noises]),
        spread=_spread(result),
        **{**factors, **pieces},  # type: ignore[arg-type]
    )


def _robot_text(source: str) -> tuple[str, bytes]:
    """File name and content of a robot file or built-in robot."""
    path = Path(source)
    if path.is_file():
        return path.name, path.read_bytes()
    folder = files("modelgen").joinpath("robots")
    name = f"{source}.urdf" if folder.joinpath(f"{source}.urdf").is_file() else f"{source}.yaml"
    return name, folder.joinpath(name).read_bytes()


def _portable(result: FitResult) -> dict[str, Any]:
    """The study's keys as plain values, recordings by absolute path, effects where the fit has them."""
    study = result.study
    data = study.model_dump(mode="json", by_alias=True, exclude_none=True, fallback=str)
    data.pop("folder", None)
    for entry, given in zip(data["recordings"], study.recordings):
        if isinstance(given.file, str):
            entry["file"] = str(study.recording_path(given).resolve())
    data.pop("effects", None)
    if terms := result.terms:
        from ident.equations.placing import entry_of

        data["effects"] = [entry_of(term, result.columns.need.joints) for term in terms]
    return data


def _spread(result: FitResult) -> np.ndarray:
    """(channels,) half width in N m that holds 95 % of the errors at the full rate where a joint moves."""
    channels = len(result.columns.channels)
    errors: list[list[np.ndarray]] = [[] for _ in range(channels)]
    for curve, system in zip(result.errors.curves, result.systems):
        if curve.role == "test":
            continue
        rows = np.concatenate([segment.t for segment in system.segments])
        nearest = np.searchsorted((rows[1:] + rows[:-1]) / 2, curve.t)
        counts = np.concatenate([segment.used for segment in system.segments], axis=1)[:, nearest]
        for k in range(channels):
            error = np.abs(curve.measured[:, k] - curve.modelled[:, k])
            errors[k].append(error[counts[k] & np.isfinite(error)])
    found = [np.concatenate(parts) for parts in errors]
    return np.array([np.quantile(part, CERTAIN) if len(part) else np.inf for part in found])


def load_fit(path: str | Path) -> SavedFit:
    """Read the folder of `ident fit`, or its fit.json. Raises SavedFitError with the file and the remedy."""
    folder, document, data, about = _opened(Path(path))
    robot = _robot_file(folder, data, about)
    study = study_from({**about["study"], "robot": robot}, folder / FILE)
    rigid = columns_of(study)
    columns, terms = _with_effects(study, rigid, about["travel"])
    if list(columns.parameters) != about["parameters"] or list(columns.channels) != about["channels"]:
        raise SavedFitError(
            f"{folder / FILE}: this version's model has other parameters than the fit; run ident fit again"
        )
    channels = range(len(columns.channels))
    noises = tuple(
        ChannelNoise(
            float(data["variance"][j]), data[f"ar_{j}"], data[f"correlation_{j}"], about["noise_rows"][j]
        )
        for j in channels
    )
    factors = {
        role: tuple(
            ChannelFactor(data[f"columns_{role}_{j}"], data[f"R_{role}_{j}"], int(data[f"rows_{role}_{j}"]))
            for j in channels
        )
        for role in about["roles"]
    }
    residuals = tuple(
        Residuals(label, role, data[f"t_{k}"], data[f"rho_{k}"].astype(float), data[f"used_{k}"])
        for k, (label, role) in enumerate(about["segments"])
    )
    return SavedFit(
        folder, document, study, columns, rigid, terms, robot, data["chi"], data["active"], data["full_chi"],
        data["full_active"], data["covariance"], data["R"], about["rss"], about["rows"],
        about["effective_rows"], data["sigma"], noises, factors, about["cutoff_hz"], residuals,
        data["spread"],
    )  # fmt: skip


def _with_effects(study: Study, rigid: Columns, travel: Sequence[float]) -> tuple[Columns, tuple[Term, ...]]:
    """The columns with the parameters of the study's effects, and these at their values."""
    if not study.effects:
        return rigid, ()
    from ident.equations.placing import layout_of, terms_of
    from ident.equations.terms import with_terms

    terms = terms_of(study, rigid, layout_of(study, rigid, travel))
    return with_terms(rigid, terms), terms


def _opened(path: Path) -> tuple[Path, dict[str, Any], dict[str, np.ndarray], dict[str, Any]]:
    """Folder, fit.json, arrays and their description; refused where they are not of one fit."""
    folder = path if path.is_dir() else path.parent
    try:
        document = json.loads((folder / "fit.json").read_text(encoding="utf-8"))
        values = {item["name"]: item["value"] for item in document["parameters"]}
    except FileNotFoundError:
        raise SavedFitError(
            f"{folder}: holds no fit.json; name the folder that ident fit or ident diagnose wrote"
        ) from None
    except (OSError, ValueError, KeyError, TypeError):
        raise SavedFitError(
            f"{folder / 'fit.json'}: is not a fit's result; name the folder of ident fit"
        ) from None
    file = folder / FILE
    try:
        with np.load(file, allow_pickle=False) as archive:
            data = {name: archive[name] for name in archive.files}
        about = json.loads(str(data["about"]))
        chi = dict(zip(about["parameters"], data["chi"].tolist()))
    except FileNotFoundError:
        raise SavedFitError(
            f"{file}: is missing beside fit.json; run ident fit again, or copy the whole folder"
        ) from None
    except Exception:  # whatever a foreign archive or text makes NumPy and JSON raise
        raise SavedFitError(f"{file}: cannot be read as a fit's numbers; run ident fit again") from None
    if about.get("format") != FORMAT:
        raise SavedFitError(f"{file}: was written by another version; run ident fit again")
    for name, value in chi.items():
        if name not in values or values[name] != value:
            raise SavedFitError(
                f"{folder / 'fit.json'}: {name} is not what fit.npz beside it has, so they are of two fits; "
                "run ident fit again"
            )
    return folder, document, data, about


def _robot_file(folder: Path, data: Mapping[str, np.ndarray], about: Mapping[str, Any]) -> str:
    """Name of the built-in robot that the fit was made with, or a file that holds its text."""
    from generated import cache

    text = data["robot"].tobytes()
    if hashlib.sha256(text).hexdigest() != about["robot_sha256"]:
        raise SavedFitError(f"{folder / FILE}: its robot file is damaged; run ident fit again")
    name = Path(about["robot"]).name
    built_in = files("modelgen").joinpath("robots", name)
    if built_in.is_file() and built_in.read_bytes() == text:
        return Path(name).stem

    def build(folder: Path) -> None:
        (folder / name).write_bytes(text)

    place = cache.entry(f"robot-{cache.key(text, name)[:40]}", build)
    return str(place / name)
