"""The ellipsoid of tool velocities for joint rates of unit norm, for an arm in a plane."""

import numpy as np

import dhkit
from dhkit.kinematics import velocity_ellipsoid

arm = dhkit.Arm.load("planar2r")
ellipsoid = velocity_ellipsoid(arm, [np.radians(30), np.radians(70)])
picture = dhkit.plot(ellipsoid)
