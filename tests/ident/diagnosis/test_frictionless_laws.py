"""Of torques that were logged less friction no law of it is asked."""

from ident.diagnosis.search.candidates import RATE, Library
from ident.diagnosis.search.searched import frictionless
from ident.examination.check import Check
from modelgen.effects import catalogue


def test_laws_of_the_rate_are_not_asked_where_friction_was_taken_off(clean_arm):
    """Of a UR10e's sixth torque a Stribeck curve that fades was told, of its fifth hysteresis."""
    check = Check("friction_compensated", ("i2", "tau_m3"), "they show no friction")
    bare = frictionless((1, 2, 3), (check, Check("torque_sign", ("i1",), "it is turned")))
    assert bare == {1, 2} and not frictionless((1, 2, 3), ())
    asked = Library(list(catalogue().values()), clean_arm.layout, frictionless=bare).places
    every = Library(list(catalogue().values()), clean_arm.layout).places
    left_out = [(e.name, place) for e, place in every if (e, place) not in asked]
    assert left_out and all(place.joint in bare for _, place in left_out)
    assert all(not (place.joint in bare and e.needs & RATE) for e, place in asked)
    assert any(place.joint == 1 and "q" in e.needs for e, place in asked)
