"""Stamps that are rounded to about a sample's length, beside rows that were lost."""

import numpy as np
import pytest
from planted import ON_RECORDINGS, measured, planted, tables, ur10e

import ident
from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit
from ident.examination.tables.excerpt import Excerpt
from ident.examination.tables.shared_stamps import spread
from ident.examination.tables.ticks import ticks
from ident.examination.tables.uneven_stamps import even_samples, uneven_stamps, uneven_steps


def _said(t, stamps, kept=slice(None)):
    q = np.stack([np.sin(0.9 * t), 0.4 * np.cos(1.7 * t)], 1)
    q += 1e-4 * np.random.default_rng(1).normal(size=q.shape)
    excerpt = Excerpt()
    excerpt.take((np.arange(len(t[kept])), stamps[kept], np.hstack([q, q])[kept]))
    return uneven_steps(excerpt, 2)


def test_rounded_stamps_are_told_and_lost_rows_are_not():
    t = np.arange(4000) / 94.0
    assert "of the steps of t are" in _said(t, np.round(t, 2))
    assert not _said(t, t, np.flatnonzero(np.random.default_rng(2).random(4000) > 0.1))
    assert not _said(t, np.round(t, 3)) and not _said(t, t)


@pytest.mark.parametrize("kind", ["where something changed", "at two rates"])
def test_rows_that_are_held_where_joints_are_slow_have_their_own_stamps(kind):
    """Steps are long as joints are slow, or all of them are: of three arms' logs it was told that stamps are
    rounded, or taken late."""
    t = np.arange(8000) / 94.0
    kept = [row for row in range(8000) if row // 400 % 3 or row % 3 == 0]
    if kind == "where something changed":
        q, kept = np.sin(0.9 * t), [0]
        for row in range(len(t)):
            if abs(q[row] - q[kept[-1]]) > 0.02:
                kept.append(row)
    assert len(kept) > 1000 and not _said(t, t, kept)


def _on_ticks(stamps):
    return ticks(lambda: np.array_split(stamps, 7))


def test_rows_that_are_missing_leave_the_others_on_their_ticks():
    """Whatever is missing, pauses included, and however long the recording; no clock where each row has a
    time of its own, or stamps scatter by as much as ticks are apart."""
    rng = np.random.default_rng(1)
    even = 17.0 + np.arange(200_000) / 250.0
    kept = (rng.random(len(even)) > 0.2) & ~((even > 300) & (even < 330))
    late = even + 0.08 / 250.0 * rng.normal(size=len(even))
    its = _on_ticks(late[kept])
    assert its.rows == kept.sum() and its.missing == (~kept).sum()
    assert its.of(late[kept]) == pytest.approx(even[kept], abs=1e-5)
    assert its.step == pytest.approx(1 / 250.0, rel=1e-9)
    assert _on_ticks(np.cumsum(rng.uniform(0.8, 1.2, size=5000)) / 250.0) is None
    assert _on_ticks(np.sort(even + 0.4 / 250.0 * rng.normal(size=len(even)))[kept]) is None
    assert _on_ticks(even[:40]) is None and _on_ticks(np.zeros(500)) is None


def test_stamps_of_a_log_with_a_pause_are_not_to_be_left_out():
    """Of an LWR4+ whose log pauses they were, and its rates wrong by stamps that scatter by a hundredth."""
    said = uneven_stamps("run", "the steps of t scatter by 0.89 %, and joints go as if none did")
    assert "off by as much" in said.message and "where no row is missing" in said.remedy


def _even(instants, stamps):
    q = np.stack([np.sin(0.9 * instants), 0.4 * np.cos(1.7 * instants)], 1)
    q += 1e-5 * np.random.default_rng(1).normal(size=q.shape)
    excerpt = Excerpt()
    excerpt.take((np.arange(len(stamps)), stamps, q))
    return even_samples(excerpt, 2)


@pytest.mark.parametrize("scatter", [0.01, 0.03, 0.1])
def test_whether_samples_or_their_stamps_scatter(scatter):
    even, lost = np.arange(4000) / 250.0, np.random.default_rng(2).random(4000) > 0.1
    uneven = even + scatter / 250.0 * np.random.default_rng(3).normal(size=4000)
    assert _even(even, uneven).startswith("the steps of t scatter by ")
    assert not _even(uneven, uneven) and not _even(uneven[lost], uneven[lost])
    assert _even(even[lost], uneven[lost]).startswith("the steps of t scatter by ")
    assert not _even(even, even) and not _even(np.zeros(4000), uneven)


@pytest.mark.long
def test_what_scattering_stamps_cost_a_fit():
    """At 1 rad/s 0.12 ms are a tenth of a milliradian: the judged error was 1.3 %, for 0.6."""
    twin = ident.simulate("scara", duration=20, rate_hz=250, seed=4)
    rng = np.random.default_rng(5)

    def fitted(scatter, wander=0.0):
        runs = {name: twin.recordings[name] for name in ("run1", "run3")}
        runs = {name: {c: np.asarray(run[c]) for c in run} for name, run in runs.items()}
        for run in runs.values():
            run["t"] = run["t"] + scatter * rng.normal(size=len(run["t"])) + wander * np.sin(run["t"] / 3)
        uses = {"run1": "identify", "run3": "validate"}
        entries = [ident.Recording(runs[name], use=use) for name, use in uses.items()]
        return ident.fit(ident.Study(robot="scara", recordings=entries))

    plain = fitted(0.0)
    for late in (fitted(1.2e-4), fitted(1.2e-4, wander=0.02)):  # of five samples
        assert [c.outcome for c in late.checks if c.check == "time_stamps"] == ["mended", "mended"]
        for use in ("identify", "validate"):
            assert late.error_percent[use]["total"] < 1.05 * plain.error_percent[use]["total"]


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize("robot", ["kuka_lwr4plus", "franka_friction_j2", "ur10e"])
def test_whose_stamps_scatter_of_measured_robots(robot):
    its = ur10e() if robot == "ur10e" else measured(robot)
    said = {c.recording for c in tables(its) if "joints go as if none did" in c.message}
    assert said == ({entry.label for entry in its.recordings} if robot == "kuka_lwr4plus" else set())


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_a_measured_log_whose_stamps_are_rounded_to_10_ms(tmp_path):
    """Its fit left a third of the torques, and nothing was said."""
    study = planted(tmp_path, lambda c: c | {"t": np.round(c["t"], 2)})
    told = [c.recording for c in tables(study) if c.check == "time_stamps"]
    assert sorted(set(told)) == sorted(entry.label for entry in study.recordings)
    assert not [c for c in tables(ur10e()) if c.check == "time_stamps"]


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize("robot", ["kinova_gen3_joint7_friction", "franka_friction_j2"])
def test_stamps_of_measured_logs_are_left_alone(robot):
    assert not [c for c in tables(measured(robot)) if c.check == "time_stamps"]


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_stamps_taken_late_are_those_of_even_samples(tmp_path):
    """Of an LWR4+ 7 % were left, for 2, where they scatter by a third of a sample."""

    def change(c):
        noise = np.random.default_rng(7).normal(size=len(c["t"]))
        return c | {"t": np.sort(c["t"] + 0.3 * np.median(np.diff(c["t"])) * noise)}

    (entry, *_) = (r for r in measured("kuka_lwr4plus").recordings if r.file.startswith("traj_b"))
    study = measured("kuka_lwr4plus").with_(
        recordings=(entry.model_copy(update={"use": "identify", "from_s": 2.0, "to_s": 14.0}),)
    )
    planted_study = planted(tmp_path, change, study)
    (said,) = (c for c in tables(planted_study) if c.check == "time_stamps")
    assert said.outcome == "mended" and "those of a uniform clock" in said.message
    errors = [ident.fit(its).error_percent["identify"]["total"] for its in (study, planted_study)]
    assert errors[1] < 1.1 * errors[0]


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_rows_lost_beside_stamps_taken_late(tmp_path):
    """Of a Barrett's judged run 11 % were left, for 4.8: the line over its row numbers was 12 ms off."""

    def change(c):
        rng, t = np.random.default_rng(5), c["t"]
        t = np.sort(t + 0.1 * np.median(np.diff(t)) * rng.normal(size=len(t)))
        kept = (rng.random(len(t)) > 0.05) | (np.arange(len(t)) == 0)
        return {name: (t if name == "t" else x)[kept] for name, x in c.items()}

    study = measured("barrett_wam_2dof")
    changed = planted(tmp_path, change, study)
    said = [c for c in tables(changed) if c.check == "time_stamps"]
    assert len(said) == len(study.recordings)
    assert all(c.outcome == "mended" and "on ticks of a uniform clock" in c.message for c in said)
    plain, late = (ident.fit(its).error_percent["validate"]["total"] for its in (study, changed))
    assert late == pytest.approx(plain, rel=0.02)


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_stamps_taken_late_are_no_clock_at_another_rate(tmp_path):
    """Of an LWR4+ whose positions came 20 ms late, too, one of an eighth was told."""

    def change(c):
        t = c["t"]
        late = {k: np.interp(t - 0.02, t, x) if k.startswith(("q", "dq")) else x for k, x in c.items()}
        thin = {k: x[::3] for k, x in late.items()}
        h = np.median(np.diff(thin["t"]))
        noise = np.random.default_rng(7).normal(size=len(thin["t"]))
        return thin | {"t": np.sort(thin["t"] + 0.3 * h * noise)}

    study = measured("kuka_lwr4plus")
    ends = {"traj_a_run1.parquet": ("identify", 1.0, 24.0), "traj_b_run1.parquet": ("validate", 14.0, 19.0)}
    runs = [r.model_copy(update=dict(zip(("use", "from_s", "to_s"), ends[r.file]))) for r in study.recordings]
    study = study.with_(recordings=tuple(runs), filter=type(study.filter)())
    checks = examine_fit(prepare_study(planted(tmp_path, change, study)))
    assert "clock_rate" not in {c.check for c in checks}


def _spread(instants, stamps):
    q = np.stack([np.sin(0.9 * instants), 0.4 * np.cos(1.7 * instants)], 1)
    q += 1e-5 * np.random.default_rng(1).normal(size=q.shape)
    excerpt, rows = Excerpt(), np.arange(len(stamps))
    excerpt.take((rows, stamps, q))
    its = spread(lambda: np.array_split(stamps, 7))
    return its.of(rows), its.is_followed(excerpt, 2)


@pytest.mark.parametrize("burst", [2, 5])
def test_rows_that_share_stamps_are_spread_where_joints_go_by_them(burst):
    """Of even samples that come in bursts, at even times or not, a uniform clock is the better one."""
    rng, n = np.random.default_rng(2), 6000
    first = np.arange(n) // burst * burst
    even = 17.0 + np.arange(n) / 100
    uneven = 17.0 + np.cumsum(rng.choice([0.010, 0.012], size=n, p=[0.7, 0.3]))
    late = np.repeat(rng.uniform(0, 0.004, size=n // burst), burst)
    made, taken = _spread(uneven, uneven[first])
    assert taken and np.abs(made - uneven)[: n - burst].max() < 0.0025
    assert not any(_spread(even, stamps)[1] for stamps in (even[first], even[first] + late))
    assert not _spread(uneven, uneven[first] + 2 * late)[1]  # whose stamps say less than no stamps


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_stamps_that_two_rows_share_each(tmp_path):
    """Of a UR10e, whose stamps are 10 and 12 ms apart, the nearest uniform clock was told and used."""

    def twice(columns):
        t, pairs = columns["t"].copy(), len(columns["t"]) // 2 * 2
        t[1:pairs:2] = t[:pairs:2]
        return columns | {"t": t}

    for stream in prepare_study(planted(tmp_path, twice, ur10e())).streams:
        (said, *_) = stream.checks
        assert said.check == "time_stamps" and "spread evenly up to the next stamp" in said.message
