"""What is told beside another hypothesis, and which of them is undone."""

from ident.examination.check import Check
from ident.examination.fits.hypothesis import Hypothesis
from ident.examination.fits.quick import Assignment
from ident.examination.undone import undoing, unsettled

HOW = Assignment((0, 1), (1.0, 1.0))
POSITION = Check(
    "angle_unit",
    ("q5",),
    "q5 looks 10 times too large: another unit",
    "columns: {q5: {scale: 0.1}}",
    open=True,
)


def beside(ahead):
    share = Hypothesis(0.0, HOW, POSITION, words="tau_l5 takes up 0.48 of tau_l4", ahead=ahead)
    return Hypothesis(3.4, HOW, POSITION, words="q5 looks 10 times too large").beside([share]).check


def test_the_first_is_undone_where_the_other_explains_no_more():
    told = beside(False)
    assert "or tau_l5 takes up 0.48 of tau_l4, these recordings do not tell which: another" in told.message
    assert undoing(told) == {"columns": {"q5": {"scale": 0.1}}} and not unsettled([told])


def test_it_is_not_where_one_that_has_no_line_explains_more():
    """Of an LWR4+ with half of its fourth torque in the fifth one the fifth position was divided by ten."""
    told = beside(True)
    assert told.message == beside(False).message
    assert undoing(told) is None and unsettled([told]) == (told,)
    assert told.remedy == "where it is the first, columns: {q5: {scale: 0.1}}"
