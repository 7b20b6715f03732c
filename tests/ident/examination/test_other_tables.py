"""Regressors of many tables at once give the torques of inverse dynamics with each alone."""

import json
import random
from dataclasses import replace

import numpy as np
import pytest
from random_robots import random_table, sliding_table

from ident.examination.fits.bodies import _alike, _standard_of_each, torques
from ident.examination.robot.axes import _exchanged, _one_turned, _reversed
from modelgen.geometry.kinematics import geometry
from modelgen.geometry.robot_file import parse_robot


@pytest.mark.parametrize("seed", range(8))
def test_of_random_robots(seed):
    rng, noise = random.Random(seed), np.random.default_rng(seed)
    robot = parse_robot(json.dumps(sliding_table(rng) if seed % 2 else random_table(rng, 4)))
    table = geometry(robot)
    joints = [str(j + 1) for j in range(len(table.moving))]
    others = [table]
    for _, rows in (*_one_turned(table.rows, joints), *_reversed(table.rows), *_exchanged(table.rows)):
        others.append(replace(table, rows=rows))
    q, dq, ddq = noise.normal(size=(3, 11, len(joints)))
    made = [its for some in _alike(others, 5) for its in _standard_of_each(some, q, dq, ddq)]
    assert len(made) == len(others) and max(len(some) for some in _alike(others, 5)) == 5
    bodies = noise.normal(size=made[0].shape[-1])
    for each, (its,) in zip(others, made):
        np.testing.assert_allclose(its @ bodies, torques(each, q, dq, ddq, bodies), rtol=1e-10, atol=1e-10)
