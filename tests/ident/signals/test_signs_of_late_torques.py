"""A torque that comes late carries the sign of then: samples whose sign is in doubt then do not count, and
the delay of a recording that was shifted by whole samples comes back inside its interval."""

import numpy as np
import pytest

import ident
from ident.equations.prepared import prepare_study
from ident.recordings.study import load_study
from ident.signals.filtering import filter_stream
from ident.twin import PlannedRun, simulate, write_simulation

pytestmark = pytest.mark.unexamined

RATE = 250.0


def joined(stream, bank):
    blocks = [block for _, block in filter_stream(stream, bank)]
    return {
        n: np.concatenate([getattr(b, n) for b in blocks]) for n in ("t", "q", "dq", "sign_dq", "certain")
    }


@pytest.mark.parametrize("late", [30, -50])
def test_samples_count_where_both_signs_are_certain(tmp_path, late):
    write_simulation(simulate("scara", "A", runs=(PlannedRun("run1", "identify", 40.0, 3),)), tmp_path)
    prepared = prepare_study(load_study(tmp_path / "study.yaml"))
    rate = prepared.streams[0].rate_hz
    n = len(prepared.columns.need.joints)
    other = prepared.with_late([[late / rate]] + [[]] * (n - 1))
    assert other is not prepared and other.with_late([[late / rate + 1e-4]] + [[]] * (n - 1)) is other
    a, b = (joined(p.streams[0], p.banks[0]) for p in (prepared, other))
    assert len(a["t"]) > 12000  # several blocks: neighbours are seen across their ends
    for name in ("t", "q", "dq", "sign_dq"):
        np.testing.assert_allclose(a[name], b[name], rtol=0, atol=1e-6)
    inside = np.arange(abs(late), len(a["t"]) - abs(late))
    both = a["certain"][inside, 0] * a["certain"][inside - late, 0]
    np.testing.assert_allclose(b["certain"][inside, 0], both, atol=1e-6)
    np.testing.assert_allclose(b["certain"][:, 1:], a["certain"][:, 1:], atol=1e-6)
    assert (b["certain"][:, 0] < a["certain"][:, 0] - 0.5).any()
    back = other.with_late([[]] * n)
    assert back.banks[0].late == ()


def shifted(robot, seed, samples, effects=()):
    """The study of a clean twin whose torques are recorded so many samples late."""
    made = ident.simulate(robot, duration=30, rate_hz=RATE, seed=seed).result
    runs = []
    for its in made.recordings:
        n, k = len(its.columns["t"]), abs(samples)
        late, early = slice(k, n), slice(0, n - k)
        now, then = (late, early) if samples > 0 else (early, late)
        data = {name: x[then if name.startswith("tau") else now] for name, x in its.columns.items()}
        runs.append(ident.Recording(data, its.use, name=its.label, payload=its.payload))
    keys = {key: value for key, value in made.study.items() if key != "recordings"}
    keys |= {"robot": str(made.robot_file.resolve())} if made.robot_file is not None else {}
    return ident.Study(recordings=runs, effects=list(effects), **keys)


@pytest.mark.parametrize("robot, seed", [("scara", 7), ("scara", 9), ("ur10e", 7)])
@pytest.mark.parametrize("samples", [4, -4])
@pytest.mark.first_case
def test_a_fitted_delay_holds_the_true_one(robot, seed, samples):
    result = ident.fit(shifted(robot, seed, samples, ["time_delay"])).result
    at = result.columns.parameters.index("time_delay.delay")
    delay, std = result.estimate.chi[at], result.std[at]
    assert std < 2e-4
    assert abs(delay - samples / RATE) < 3 * std


@pytest.mark.long
def test_a_delay_that_is_traced_holds_the_true_one():
    document = ident.diagnose(shifted("scara", 7, 4)).document()
    assert [f["effect"] for f in document["findings"]] == ["time_delay"]
    assert not document["unexplained"]
    delay = document["findings"][0]["parameters"]["delay"]
    assert delay["std"] < 4e-4
    assert abs(delay["value"] - 4 / RATE) < 3 * delay["std"]
