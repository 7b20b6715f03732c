"""What others of an effect's kind, at other shapes, change by from one run to the next."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from types import MappingProxyType, SimpleNamespace

import numpy as np
import pytest

from benchmarks.planted_faults import BASES, DATA, FAULTS, planted
from ident.diagnosis import diagnose_study
from ident.diagnosis.evidence.evidence import weigh
from ident.diagnosis.evidence.metric import Metric
from ident.diagnosis.evidence.state import Found
from ident.diagnosis.rows.rows import Rows
from ident.diagnosis.search.of_its_kind import times_noise_of_its_kind
from ident.diagnosis.search.parameters_apart import beside_changes
from ident.recordings.study import load_study
from ident.report.unexplained_words import unexplained_sentence

TAU, M = 8.3, 2400
Q = np.concatenate([2 * np.sin(np.linspace(0, 9 * np.pi, M // 2)), 2 * np.cos(np.linspace(0, 7, M // 2))])


@dataclass(frozen=True)
class Wave:
    """A term of one shape, as far as it is asked."""

    theta: MappingProxyType
    factor: float = 1.0
    place: None = None
    most: float = 300.0

    @property
    def effect(self):
        return SimpleNamespace(bounds=lambda place: {"wavenumber": (1.0, self.most)})

    def at(self, **theta):
        return replace(self, theta=MappingProxyType({**self.theta, **theta}))


@dataclass(frozen=True)
class Others:
    """The state without it, as far as it is asked."""

    rows: Rows
    made: Callable[[Rows], Metric]
    columns: Callable
    problem = SimpleNamespace(asked=31)  # waves of its kind

    @property
    def metric(self):
        return self.made(self.rows)

    @property
    def scene(self):
        return SimpleNamespace(columns=lambda term: {0: self.columns(term)})


def waves(term):
    k = term.theta["wavenumber"]
    return np.column_stack([np.sin(k * Q), np.cos(k * Q)])


def case(tiny, seed, smooth, wild, size, columns=waves):
    """What a model of six polynomials lacks: of each side another smooth torque, or other waves of many
    wavenumbers; a wave of 30 of a size."""
    rng = np.random.default_rng(seed)
    X = np.polynomial.legendre.legvander(Q / 2, 5)
    sides = np.arange(M) < M // 2

    def each(Z, size):
        return np.where(sides, *(size * Z @ rng.normal(size=(Z.shape[1], 2))).T)

    many = np.hstack([waves(Wave({"wavenumber": 30 * 1.04**k})) for k in range(-40, 41)])
    wave = Wave(MappingProxyType({"wavenumber": 30.0}))
    y = each(np.polynomial.legendre.legvander(Q / 2, 5), smooth) + each(many, wild / np.sqrt(81))
    y = y + size * columns(wave)[:, 0] + rng.normal(size=M)
    others = Others(tiny["rows"](X, y), tiny["metric"], columns)
    return others, found(others, wave)


def found(others, wave):
    columns = others.scene.columns(wave)
    return Found(wave, columns, weigh(others.metric, columns).sizes)


def test_a_wave_is_there_though_the_parameters_change(tiny):
    for seed in range(10):
        others, f = case(tiny, seed, 1.0, 0.0, 0.5)
        beside = beside_changes(others, f, TAU)
        by_parameters = beside_changes(others, replace(f, term=None), TAU)
        assert by_parameters.kappa > 5 and not by_parameters.of_its_kind
        assert beside.of_its_kind and beside.kappa < 2 and beside.log_e > TAU


@pytest.mark.long
def test_one_of_many_waves_that_change_is_none(tiny):
    told = passed = 0
    for seed in range(15):
        others, f = case(tiny, 100 + seed, 0.0, 3.0, 0.0)
        every = [found(others, f.term.at(wavenumber=30 * 1.04**k)) for k in range(-15, 16)]
        f = max(every, key=lambda its: weigh(others.metric, its.columns).log_e)
        told += weigh(others.metric, f.columns).log_e > TAU
        beside = beside_changes(others, f, TAU)
        passed += beside is not None and beside.log_e > TAU
    assert told >= 5 and passed <= 1


def test_shapes_that_are_all_alike_say_nothing_of_it(tiny):
    def curve(term):
        return np.tanh(Q / term.theta["wavenumber"])[:, None]

    others, f = case(tiny, 3, 1.0, 0.0, 1.0, curve)
    assert times_noise_of_its_kind(others, others.metric, f) is None
    assert times_noise_of_its_kind(others, others.metric, replace(f, term=None)) is None


def test_a_strong_wave_over_a_short_way_makes_no_change_of_others(tiny):
    """Others are not quite apart from it, and take up some of it, by where a run goes: of a ripple of 265
    nats they changed by 57 times the noise, and it was no name."""

    def short(term):
        angle = term.theta["wavenumber"] / 4 * (Q / 2 + np.where(np.arange(M) < M // 2, 0.6, -0.6))
        return np.column_stack([np.sin(angle), np.cos(angle)])

    for seed in range(5):
        others, f = case(tiny, seed, 0.0, 0.0, 8.0, short)
        beside = beside_changes(others, f, TAU)
        assert beside.of_its_kind and beside.kappa < 2 and beside.log_e > 100


def test_a_shape_beyond_its_bounds_is_not_asked(tiny):
    """It may be no number: the root of a counterbalance's geometry, beyond 1, ended a diagnosis."""
    others, f = case(
        tiny, 0, 1.0, 0.0, 0.5, lambda t: waves(t) * (1.0 if t.theta["wavenumber"] <= 40 else np.nan)
    )
    f = replace(f, term=replace(f.term, most=40.0))
    kappa = times_noise_of_its_kind(others, others.metric, f)
    assert 1.0 <= kappa < 2.0


def test_the_sentence_says_what_changes():
    item = {
        "joints": [1], "channel": "tau_m", "depends_on": ["q1"], "share_of_residual_percent": 26.1,
        "log_e": 20.1, "nearest": {"effect": "torque_ripple", "joints": [1], "log_e": 20.1},
        "carries_over": True, "parameters_change_times_noise": None, "its_kind_changes_times_noise": 4.7,
    }  # fmt: skip
    assert "others of its kind change 4.7 times as much as noise makes them" in unexplained_sentence(item)


@pytest.mark.long
@pytest.mark.skipif(not DATA.exists(), reason="the recordings of measured robots are not here")
def test_a_ripple_of_a_measured_joint_whose_parameters_change(tmp_path):
    """Of a Barrett's: 42 nats, and its parameters change by 7 times the noise."""
    base = next(b for b in BASES if b.robot == "barrett_wam_2dof")
    fault = next(f for f in FAULTS if f.name.startswith("a ripple"))
    diagnosis = diagnose_study(load_study(planted(base, fault, tmp_path)))
    assert [(f.effect, f.joints) for f in diagnosis.findings] == [("torque_ripple", (2,))]
    assert diagnosis.findings[0].parameters["wavenumber"]["value"] == pytest.approx(30, abs=0.6)
