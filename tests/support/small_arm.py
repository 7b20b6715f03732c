"""A robot file of three joints, small enough to derive in a second."""

ARM = """\
name: small
convention: mdh
gravity: [0, 0, -9.81]
links:
  - {joint: revolute, antecedent: 0, alpha: 0,    d: 0,   theta: q1, r: 0.2}
  - {joint: revolute, antecedent: 1, alpha: pi/2, d: 0,   theta: q2, r: 0}
  - {joint: revolute, antecedent: 2, alpha: 0,    d: 0.3, theta: q3, r: 0}
"""
