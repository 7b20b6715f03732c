"""Measured recordings with a defect planted in them, for the tests of what is said about it."""

import os
from importlib.resources import files
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml

from benchmarks import planted_faults, strangers_faults
from ident.equations.prepared import prepare_study
from ident.errors import RecordingError
from ident.examination.examine import examine_fit, examine_tables
from ident.examination.fits.hypothesis import Asked
from ident.examination.fits.quick import quick_of
from ident.examination.fits.samples import take
from ident.recordings.study import load_study

DATA = Path(os.environ.get("DYNIDENT_DATA") or Path(__file__).parents[3] / "shared" / "data")
ON_RECORDINGS = [
    pytest.mark.real_data,
    pytest.mark.skipif(
        not DATA.is_dir(), reason=f"the recordings are not at {DATA}; set DYNIDENT_DATA to their folder"
    ),
]


def ur10e():
    study = load_study(str(files("ident").joinpath("studies", "ur10e.yaml")))
    keep = ("excite_a_50s", "excite_c_30s")
    return study.with_(recordings=tuple(e for e in study.recordings if e.label in keep))


def planted(folder, change, study=None):
    study = study or ur10e()
    for path in {study.recording_path(entry) for entry in study.recordings}:
        table = pq.read_table(path)
        columns = {name: table[name].to_numpy() for name in table.column_names if name != "pose"}
        columns = {name: np.asarray(values, float) for name, values in columns.items()}
        pq.write_table(pa.table({k: pa.array(v) for k, v in change(columns).items()}), folder / path.name)
    return study.with_(folder=str(folder))


def strangers_log(folder, robot, how, change):
    """The study of a measured robot as the benchmark of strangers' logs has it, with its log changed."""
    (base,) = (b for b in planted_faults.BASES if b.robot == robot)
    log = strangers_faults.log_of(base, how, np.random.default_rng(0))
    change(log)
    for name, table in log.tables.items():
        pq.write_table(pa.table(table), folder / f"{name}.parquet")
    for name, what in (("robot.yaml", log.robot), ("study.yaml", log.study)):
        (folder / name).write_text(yaml.safe_dump(what), encoding="utf-8")
    return load_study(folder / "study.yaml")


def with_fault(robot, words, folder):
    """The study of a measured robot with the everyday fault of the benchmark that begins with these words."""
    if not (DATA / robot).is_dir():
        pytest.skip("the recordings of measured robots are not here")
    (base,) = (b for b in planted_faults.BASES if b.robot == robot)
    (fault,) = (f for f in planted_faults.FAULTS if f.name.startswith(words))
    return planted_faults.planted(base, fault, folder)


def measured(robot):
    path = DATA / robot / "study.yaml"
    return load_study(path if path.is_file() else str(files("ident").joinpath("studies", f"{robot}.yaml")))


def live_arm():
    """The dual arm without its dead sensors."""
    keep = [f"tau_m{j}" for j in range(1, 8)] + [f"tau_l{j}" for j in range(1, 5)]
    return measured("dualarm_v2_7dof").with_(channels=tuple(keep))


def refused(study):
    with pytest.raises(RecordingError) as caught:
        prepared = prepare_study(study)
        examine_fit(prepared)
    return str(caught.value), {check.check for check in caught.value.checks if check.outcome == "refused"}


def tables(study):
    return examine_tables(prepare_study(study))


def changed(name, values):
    return lambda columns: columns | {name: values(columns[name])}


def rows(x, at, values):
    out = x.copy()
    out[at] = values
    return out


def parted(study, fitted, judged):
    """Its only recording to `fitted` s to identify, from there to `judged` s to validate."""
    (entry,) = {r.file: r for r in study.recordings}.values()
    runs = [
        entry.model_copy(update={"use": use, "name": use, "from_s": begin, "to_s": end})
        for use, begin, end in (("identify", None, fitted), ("validate", fitted, judged))
    ]
    return study.with_(recordings=tuple(runs), filter=type(study.filter)())


def thinned(path, every=4):
    """The study in that file with each `every`-th row of its recordings: what a fault says at a lower rate
    takes half the time to be found."""
    study = yaml.safe_load(path.read_text(encoding="utf-8"))
    folder = path.parent / study.pop("folder", "")
    for name in {entry["file"] for entry in study["recordings"]}:
        pq.write_table(pq.read_table(folder / name)[::every], path.parent / f"thin_{Path(name).name}")
    for entry in study["recordings"]:
        entry["file"] = f"thin_{Path(entry['file']).name}"
    path.write_text(yaml.safe_dump(study, sort_keys=False), encoding="utf-8")
    return path


def asked_of(study):
    """What a quick fit asks of a study's signals, with nothing undone."""
    made = prepare_study(study.with_(filter=type(study.filter)()))
    columns, maps = made.columns, dict(study.columns)
    samples = [s for role in ("identify", "validate") for s in take(made.streams, made.banks, columns, role)]
    quick = quick_of(columns, samples)
    how = quick.plain()
    return Asked(quick, how, quick.fit(how), maps, False, np.ones(len(how.order)))
