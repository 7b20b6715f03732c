"""One kept fit of a small simulated recording, for all tests of this folder."""

import pytest
from recordings import recording, write_parquet, write_study

from ident.estimation.fit import fit_study
from ident.export.saved import load_fit
from ident.recordings.study import load_study
from ident.report.files import write_into


@pytest.fixture(scope="session")
def fitted(tmp_path_factory):
    """(FitResult, folder of its files): a bare run and a loaded one, part of the first for validation."""
    folder = tmp_path_factory.mktemp("fit")
    for seed, name in ((1, "a"), (2, "b")):
        columns, _ = recording(payload="L", seed=seed, carried=seed == 2)
        write_parquet(folder / f"{name}.parquet", columns)
    entries = [
        {"file": "a.parquet", "use": "identify"},
        {"file": "b.parquet", "use": "identify", "payload": "L"},
        {"file": "a.parquet", "name": "c", "use": "validate", "from": 15},
    ]
    result = fit_study(load_study(write_study(folder, entries)))
    (folder / "out").mkdir()
    write_into(result, folder / "out", plots=False)
    return result, folder / "out"


@pytest.fixture(scope="session")
def kept(fitted):
    return load_fit(fitted[1])
