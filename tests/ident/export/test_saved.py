"""A fit's folder gives back the fit, and says what is wrong with it when files are missing or mixed up."""

import json
import shutil

import numpy as np
import pytest

from ident.export.saved import SavedFitError, load_fit

pytestmark = pytest.mark.unexamined


def test_everything_comes_back(fitted):
    result, folder = fitted
    for path in (folder, folder / "fit.json"):
        fit = load_fit(path)
        assert fit.columns.parameters == result.columns.parameters and fit.study.payloads == ("L",)
        np.testing.assert_array_equal(fit.chi, result.estimate.chi)
        np.testing.assert_array_equal(fit.covariance, result.full_covariance)
        np.testing.assert_array_equal(fit.noises[3].coefficients, result.noises[3].coefficients)
        assert fit.effective_rows == result.effective_rows and fit.spread.shape == (7,)
        assert set(fit.factors) == {"identify", "validate"}


def test_factors_give_the_residuals_of_the_recordings(fitted):
    result, folder = fitted
    fit = load_fit(folder)
    for role in fit.factors:
        rho = np.hstack([r for s in result.systems if s.role == role for r in s.residuals(fit.chi)])
        Y = np.hstack([seg.Y for s in result.systems if s.role == role for seg in s.segments])
        expected = 100 * np.linalg.norm(rho) / np.linalg.norm(Y)
        assert fit.error_percent(fit.chi, role)["total"] == pytest.approx(expected, rel=1e-9)


def test_a_moved_folder_still_works(fitted, tmp_path):
    _, folder = fitted
    shutil.copytree(folder, tmp_path / "elsewhere")
    assert load_fit(tmp_path / "elsewhere").columns.model.robot_name == "kuka_lwr4p"


def _edited(folder):
    document = json.loads((folder / "fit.json").read_text())
    document["parameters"][0]["value"] += 1.0
    (folder / "fit.json").write_text(json.dumps(document))


@pytest.mark.parametrize(
    ("harm", "words"),
    [
        (lambda f: (f / "fit.json").unlink(), "holds no fit.json"),
        (lambda f: (f / "fit.npz").unlink(), "is missing beside fit.json"),
        (lambda f: (f / "fit.npz").write_bytes(b"PK nonsense"), "cannot be read"),
        (lambda f: (f / "fit.json").write_text("[1, 2]"), "is not a fit's result"),
        (_edited, "of two fits"),
    ],
)
def test_foreign_files_are_refused_in_one_sentence(fitted, tmp_path, harm, words):
    shutil.copytree(fitted[1], tmp_path / "fit")
    harm(tmp_path / "fit")
    with pytest.raises(SavedFitError, match=words) as error:
        load_fit(tmp_path / "fit")
    assert str(tmp_path / "fit") in str(error.value) and "\n" not in str(error.value)
