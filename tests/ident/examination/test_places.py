"""Torques, or positions, in another order than the joints."""

import pyarrow as pa
import pytest
from planted import ON_RECORDINGS, asked_of, measured, planted, strangers_log
from small_arm import ARM

import ident
from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit
from ident.examination.positions.places import other_torques, regular_orders, swapped
from ident.twin import simulate


@pytest.mark.parametrize(("kind", "order"), [("tau_m", (2, 3, 1)), ("tau_m", (3, 1, 2)), ("q", (2, 3, 1))])
@pytest.mark.long
def test_moved_by_one_place(tmp_path, kind, order):
    """Of an LWR4+'s positions two pairs were told."""
    (tmp_path / "small.yaml").write_text(ARM)
    runs = []
    for its in simulate(tmp_path / "small.yaml", seed=5).recordings:
        moved = {f"{kind}{j}": its.columns[f"{kind}{k}"] for j, k in zip((1, 2, 3), order)}
        runs.append(ident.Recording(pa.table(dict(its.columns) | moved), its.use, name=its.label))
    study = ident.Study(robot=str(tmp_path / "small.yaml"), recordings=runs)
    (check,) = [c for c in ident.fit(study).checks if c.check != "poor_excitation"]
    assert check.check == "swapped_signals" and check.signals == tuple(f"{kind}{j}" for j in (1, 2, 3))
    mended = study.with_(columns={f"{kind}{j}": f"{kind}{order.index(j) + 1}" for j in (1, 2, 3)})
    lines = ", ".join(f"{name}: {its.column}" for name, its in mended.columns.items())
    assert check.remedy == f"columns: {{{lines}}}"


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize(
    ("order", "robot"),
    [pytest.param("from the tip", "kuka_lwr4plus", marks=pytest.mark.long), ("from the next joint", "ur10e")],
)
def test_of_a_measured_robot(tmp_path, robot, order):
    """Of an LWR4+ the sixth torque looked turned, of a UR10e nothing was explained."""
    kind, n = {"ur10e": ("i", 6), "kuka_lwr4plus": ("tau_l", 7)}[robot]
    joints = list(range(1, n + 1))
    other = joints[::-1] if order == "from the tip" else joints[1:] + joints[:1]
    study = measured(robot)
    if robot == "ur10e":
        keep = ("excite_a_50s", "excite_c_30s")
        study = study.with_(recordings=tuple(e for e in study.recordings if e.label in keep))
    change = lambda c: c | {f"{kind}{j}": c[f"{kind}{k}"] for j, k in zip(joints, other)}  # noqa: E731
    said = [c for c in examine_fit(prepare_study(planted(tmp_path, change, study))) if not c.hint]
    lines = [f"{kind}{k}: {kind}{j}" for j, k in sorted(zip(joints, other), key=lambda its: its[1]) if j != k]
    assert [c.remedy for c in said] == [f"columns: {{{', '.join(lines)}}}"]


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_two_torques_exchanged_beside_a_turned_one(tmp_path):
    """Of a rokae the two were told to be turned, and the third one not."""
    change = lambda c: c | {"tau_l2": c["tau_l3"], "tau_l3": c["tau_l2"], "tau_l4": -c["tau_l4"]}  # noqa: E731
    asked = asked_of(planted(tmp_path, change, measured("rokae_xmate3pro")))
    best = max(swapped(asked), key=lambda h: h.gain)
    assert best.check.remedy == "columns: {tau_l2: tau_l3, tau_l3: tau_l2, tau_l4: {sign: -1}}"


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize("judged", [False, True])
def test_joints_that_move_alike_are_not_exchanged(judged):
    """Of an LWR4+ five of whose joints follow one signal the last two were told as exchanged, and where a
    quarter of it judges the fifth with the seventh: any torque of their positions explains more."""
    study = measured("kuka_lwr4plus")
    (entry,) = [e for e in study.recordings if e.file.startswith("traj_a")][:1]
    parts = [("identify", None, 15.48), ("validate", 15.48, 20.3)] if judged else [("identify", None, None)]
    runs = [
        entry.model_copy(update={"use": use, "name": use, "from_s": begin, "to_s": end})
        for use, begin, end in parts
    ]
    checks = examine_fit(prepare_study(study.with_(recordings=tuple(runs), filter=type(study.filter)())))
    assert "swapped_signals" not in {c.check for c in checks}


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize("pairs", [((1, 5),), ((1, 5), (2, 4))])
def test_small_torques_are_told_in_no_other_order_with_those_that_are(tmp_path, pairs):
    """Of an LWR4+ with the first pair exchanged the sixth and seventh were told to be, too."""
    order = {j: k for pair in pairs for j, k in (pair, pair[::-1])}
    change = lambda c: c | {f"tau_l{j}": c[f"tau_l{k}"] for j, k in order.items()}  # noqa: E731
    b, a = measured("kuka_lwr4plus").recordings
    parts = ((a, "identify", 1.0, 24.0), (b, "identify", None, 14.0), (b, "validate", 14.0, 19.0))
    runs = [
        entry.model_copy(update={"use": use, "name": f"{k}", "from_s": begin, "to_s": end})
        for k, (entry, use, begin, end) in enumerate(parts)
    ]
    study = measured("kuka_lwr4plus").with_(recordings=tuple(runs))
    study = planted(tmp_path, lambda c: {k: x[::2] for k, x in change(c).items()}, study)
    told = [set(h.check.signals) for h in other_torques(asked_of(study))]
    assert told == ([{f"tau_l{j}" for j in order}] if len(pairs) > 1 else [])


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_a_small_torque_is_told_in_no_other_place_than_one_exchanged_would_be(tmp_path):
    """Of an LWR4+ with its first and sixth torque exchanged the first, sixth and seventh were told."""

    def change(log):
        for table in log.tables.values():
            table["tau_l1"], table["tau_l6"] = table["tau_l6"], table["tau_l1"]

    study = strangers_log(tmp_path, "kuka_lwr4plus", (0, False, False, True), change)
    assert not list(other_torques(asked_of(study)))


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize("order", [(1, 2, 4, 5, 6, 3), (1, 6, 2, 3, 4, 5)])
def test_positions_moved_by_one_from_a_place_on(tmp_path, order):
    """Of an AIRBOT and a UR10e two positions were told to be exchanged, and torques in another order."""
    moved = [(j, k) for j, k in enumerate(order, 1) if j != k]
    change = lambda c: c | {f"{x}{j}": c[f"{x}{k}"] for x in ("q", "dq") for j, k in moved}  # noqa: E731
    (told,) = examine_fit(prepare_study(planted(tmp_path, change)))
    lines = [f"{x}{k}: {x}{j}" for x in ("q", "dq") for j, k in sorted(moved, key=lambda its: its[1])]
    assert told.remedy == f"columns: {{{', '.join(lines)}}}"


def test_orders_of_a_header():
    assert regular_orders([5, 6]) == []
    assert regular_orders([4, 5, 6]) == [[5, 6, 4], [6, 4, 5], [6, 5, 4]]
    assert [0, 1, 3, 4, 2] in regular_orders([0, 1, 2, 3, 4])
