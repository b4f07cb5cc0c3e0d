"""TOPP-RA on sampled derivatives: python toppra_peer.py DATA STATIONS AXES LENGTH VELOCITY ACCELERATION REPEATS.

DATA holds f64: p' of every station (all axes of one station together), then p''. Prints one JSON object: set-up and
computing time [s], the least of the repeats, traverse time [s] and the version.
"""

import json
import logging
import sys
import time
from importlib.metadata import version

import numpy as np
import toppra as ta
import toppra.algorithm as algo
import toppra.constraint as constraint
from toppra.interpolator import AbstractGeometricPath


class Sampled(AbstractGeometricPath):
    """A path known at its grid points."""

    def __init__(self, first, second, length):
        self.first, self.second, self.length = first, second, length

    def __call__(self, positions, order=0):
        return (None, self.first, self.second)[order] if order else np.zeros_like(self.first)

    @property
    def dof(self):
        return self.first.shape[1]

    @property
    def path_interval(self):
        return np.array([0.0, self.length])


def main():
    data, stations, axes = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    length, velocity, acceleration = (float(v) for v in sys.argv[4:7])
    logging.getLogger("toppra").setLevel(logging.ERROR)
    first, second = np.fromfile(data).reshape(2, stations, axes)
    path = Sampled(first, second, length)
    grid = np.linspace(0.0, length, stations)
    limits = [
        constraint.JointVelocityConstraint([velocity] * axes),
        constraint.JointAccelerationConstraint(
            [acceleration] * axes, discretization_scheme=constraint.DiscretizationType.Collocation
        ),
    ]
    setup, compute, profile = [], [], None
    for _ in range(int(sys.argv[7])):
        begin = time.perf_counter()
        instance = algo.TOPPRA(limits, path, gridpoints=grid, solver_wrapper="seidel")
        made = time.perf_counter()
        _, profile, _ = instance.compute_parameterization(0.0, 0.0)
        done = time.perf_counter()
        setup.append(made - begin)
        compute.append(done - made)
    if profile is None or np.isnan(profile).any():
        sys.exit("toppra finds no profile")
    seconds = float(np.sum(2.0 * np.diff(grid) / (profile[1:] + profile[:-1])))
    print(json.dumps({"setup": min(setup), "compute": min(compute), "time": seconds, "version": version("toppra")}))


main()
