"""What a study leaves out on all joints is one hypothesis."""

from dataclasses import replace

import numpy as np
import pytest
from planted import DATA, ON_RECORDINGS
from small_arm import ARM

import ident
from benchmarks.planted_faults import BASES, FAULTS, planted
from ident.diagnosis import diagnose_study
from ident.diagnosis.opening import opened
from ident.diagnosis.outcome import threshold
from ident.diagnosis.rows.terms import Term
from ident.diagnosis.search.candidates import Library, Ranked
from ident.diagnosis.search.left_out import left_out
from ident.diagnosis.search.settling import settled_in
from ident.diagnosis.search.weighing import compared
from ident.equations.prepared import prepare_study
from ident.recordings.study import load_study, study_from
from ident.twin import PlannedRun, Sensors, simulate, write_simulation
from modelgen.effects import catalogue


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    """study(bump [N m]): an arm whose second torque has such a bump about 0.5 rad/s, a law without a name."""
    folder = tmp_path_factory.mktemp("left_out")
    (folder / "robot.yaml").write_text(ARM)
    runs = (PlannedRun("run1", "identify", 14.0), PlannedRun("run2", "validate", 10.0))

    def study(bump):
        made = simulate(folder / "robot.yaml", "A", (), seed=3, sensors=Sensors(rate_hz=200.0), runs=runs)
        for run in made.recordings:
            rate = np.gradient(run.columns["q2"], run.columns["t"])
            run.columns["tau_m2"] = run.columns["tau_m2"] + bump * np.exp(-((rate - 0.5) ** 2) / 0.05)
        return load_study(write_simulation(made, folder / f"bump{bump}"))

    return study


@pytest.fixture(scope="module")
def arm(simulated):
    return simulated(0.0)


@pytest.mark.parametrize("name", ["viscous_friction", "coulomb_friction"])
def test_all_joints_are_asked_at_once(arm, name):
    begun = opened(prepare_study(arm.with_(without=(name,))))
    library = Library(list(catalogue().values()), begun.layout)
    state, told = left_out(begun.state, library, threshold(0.01))
    assert {(term.effect.name, term.place.joint) for term, _ in told} == {(name, j) for j in range(3)}
    assert all(e.log_e > threshold(0.01) for _, e in told) and len(state.terms) == 3


def test_nothing_is_asked_of_a_whole_model(arm):
    begun = opened(prepare_study(arm))
    library = Library(list(catalogue().values()), begun.layout)
    assert left_out(begun.state, library, threshold(0.01)) is None


def asked(study):
    """Names and joints (from 1) of what a study could have left out and the diagnosis asks for."""
    library = Library(list(catalogue().values()), opened(prepare_study(study)).layout)
    return {(e.name, place.joint + 1) for e, place in library.places if e.replaces}


def test_only_what_was_taken_out_is_asked_for(arm):
    """A term of the model is its own column but for what fine samples make of the turns: on a minute of a
    twin at 1 kHz that said 10 nats. The first two rotors stand in ZZ1R and ZZ2R, which stay."""
    assert asked(arm) == set()
    assert asked(arm.with_(without=("viscous_friction:2",))) == {("viscous_friction", 2)}
    assert asked(arm.with_(without=("rotor_inertia",))) == {("rotor_inertia", 3)}


@pytest.mark.long
def test_it_is_told_whatever_else_is_there(simulated):
    """Beside a bump of the second torque over its rate, which functions of the rate learn together with its
    viscous friction, this was taken back, and 5.4 % of error were left where 3.3 are."""
    d = diagnose_study(simulated(0.2).with_(without=("viscous_friction",)))
    told = {(f.effect, *f.joints) for f in d.findings}
    assert told == {("viscous_friction", joint) for joint in (1, 2, 3)}
    assert 2 in {joint for u in d.unexplained for joint in u.joints}


class TestOnRecordings:
    pytestmark = ON_RECORDINGS

    @pytest.mark.long
    def test_joints_that_say_too_little_alone(self):
        """Three seconds of a TX40: alone no joint's viscous friction lowered the judging error."""
        file = str(DATA / "staubli_tx40" / "excite_first.parquet")
        runs = [
            {"file": file, "use": "identify", "to": 2.8, "name": "a"},
            {"file": file, "use": "validate", "from": 2.8, "to": 3.9, "name": "b"},
        ]
        keys = {"model": "A", "recordings": runs, "coupled_drives": [[5, 6]], "without": ["viscous_friction"]}
        study = study_from({"robot": "staubli_tx40", **keys}, DATA / "staubli_tx40" / "study.yaml")
        d = diagnose_study(study)
        assert {f.effect for f in d.findings} == {"viscous_friction"}
        assert {1, 2, 3, 4} <= {joint for f in d.findings for joint in f.joints}
        before, after = (fit.full_rate_error["validate"]["total"] for fit in (d.first, d.last))
        assert after < 0.3 * before


def test_what_was_left_out_is_settled_in_where_a_turn_over_has_taken_its_place(arm):
    """Asked for by the fitted rows it is tried beside a turn-over taken anew, however little the judged rows
    say of it beside the one that took its place."""
    begun = opened(prepare_study(arm.with_(without=("viscous_friction:2",))))
    state, tau = begun.state, threshold(0.01)
    effects, places = catalogue(), {}
    for name in ("viscous_friction", "stribeck_friction"):
        places[name] = next(p for p in effects[name].places(begun.layout) if p.joint == 1)
    listed = [Ranked(Term(effects[n], p, {"vs": 0.1} if "stri" in n else {}), 0.0) for n, p in places.items()]
    weighed = compared(state, listed, tau, 0.01)
    little = tuple((r, replace(e, log_e=5.0) if r.term.effect.replaces else e) for r, e in weighed.all)
    best = next(r for r, _ in little if not r.term.effect.replaces)
    held = settled_in(state, replace(weighed, all=little), best, 1, tau, 0.01)
    assert held is not None and held.refined.term.effect.name == "viscous_friction"
    assert held.evidence.log_e > tau


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_friction_that_turns_over_slowly_is_asked_as_it_does(tmp_path):
    """Of an LWR4+ without Coulomb friction a sign that turns at once said 1 nat of the fitted rows."""
    base = next(b for b in BASES if b.robot == "kuka_lwr4plus")
    fault = next(f for f in FAULTS if f.name.startswith("Coulomb"))
    begun = opened(prepare_study(load_study(planted(base, fault, tmp_path))))
    library = Library(list(catalogue().values()), begun.layout)
    state, told = left_out(begun.state, library, threshold(0.01))
    assert {term.effect.name for term, _ in told} == {"coulomb_friction"} and len(state.terms) == 7


@pytest.mark.long
def test_the_error_told_is_that_of_a_torque_that_the_effect_acts_in(tmp_path):
    """(Of a motor's offset the error of the sensor was told, of a sensor's the motor's.)"""
    (tmp_path / "robot.yaml").write_text(ARM)
    twin = ident.simulate(tmp_path / "robot.yaml", "C", duration=30, rate_hz=200, noise=1.0, seed=4)
    found = ident.diagnose(twin.study.with_(without=("offset:2",))).document()["findings"]
    assert {f["effect"] for f in found} == {"offset"}
    assert {(f["side"], f["channel"]) for f in found} == {("motor", "tau_m"), ("sensor", "tau_l")}
