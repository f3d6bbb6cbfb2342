"""Sensors of joint values and rates: encoders of finite resolution, and noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dhkit.description import Array
from dhkit.description.arrays import number_array
from dhkit.display import value_line


@dataclass(frozen=True, eq=False)
class Sensors:
    """Measured joint values and rates instead of the true ones.

    A joint value gets normal noise and is then rounded to the encoder's resolution. A rate is the true one with noise,
    as from a tachometer, or with ``differences=True`` the difference of two measured joint values over a period, as
    most drives compute it: one count of the encoder is then an error of the rate of resolution x sampling rate.

    Parameters
    ----------
    noise
        Standard deviation of joint values, rad and m: a number, or shape (n,).
    rate_noise
        Standard deviation of rates, rad/s and m/s, likewise.
    resolution
        Change of the joint value for one count of the encoder, rad and m (2 pi / counts / gear), likewise; 0 for exact
        values.
    differences
        Whether rates are differences of measured joint values.
    seed
        Seed of the noise, which is the same in every run.

    Raises
    ------
    ValueError
        A number that is negative or not finite.
    """

    noise: ArrayLike = 0.0
    rate_noise: ArrayLike = 0.0
    resolution: ArrayLike = 0.0
    differences: bool = False
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("noise", "rate_noise", "resolution"):
            value = number_array(getattr(self, name), name, "a number, or one for each joint")
            if value.ndim > 1 or not (np.isfinite(value).all() and (value >= 0).all()):
                raise ValueError(
                    f"{name} is {value.tolist()}; expected finite numbers, 0 or more: one, or one for each joint"
                )
            object.__setattr__(self, name, value)
        if type(self.seed) is not int or self.seed < 0:
            raise ValueError(f"seed is {self.seed!r}; expected a whole number, 0 or more")

    def start(self, n: int, period: float) -> Measuring:
        """Start the measurement of one run of an arm with n joints, at samples ``period`` (s) apart.

        Parameters
        ----------
        n
            Number of joints.
        period
            Time between two samples, s.

        Raises
        ------
        ValueError
            Arrays whose length is not n.
        """
        for name in ("noise", "rate_noise", "resolution"):
            shape = np.shape(getattr(self, name))
            if shape not in ((), (n,)):
                raise ValueError(f"{name} has shape {shape}; expected a number, or ({n},)")
        return Measuring(self, period)

    __repr__ = value_line


class Measuring:
    """Sensors during one run, with the state of their noise."""

    def __init__(self, sensors: Sensors, period: float) -> None:
        self._sensors = sensors
        self._period = period
        self._random = np.random.default_rng(sensors.seed)
        self._before: Array | None = None

    def __call__(self, q: Array, qd: Array) -> tuple[Array, Array]:
        """Return the measured joint values and rates of the next sample, shape (..., n) each, rad, m and per second."""
        sensors = self._sensors
        noise = np.asarray(sensors.noise)
        measured = q + noise * self._random.standard_normal(q.shape) if noise.any() else q.copy()

        # An encoder counts steps: q_measured = round(q / resolution) resolution.
        counts = np.asarray(sensors.resolution)
        if counts.any():
            size = np.where(counts > 0, counts, 1.0)
            measured = np.where(counts > 0, np.round(measured / size) * size, measured)

        # The difference over a period, (q_k - q_(k-1)) / period, or 0 at the first sample, which has none before it.
        if sensors.differences:
            rate = (
                np.zeros_like(q)
                if self._before is None
                else (measured - self._before) / self._period
            )
        else:
            rate = qd + np.asarray(sensors.rate_noise) * self._random.standard_normal(qd.shape)
        self._before = measured
        return measured, rate
