"""The paper's scene, start and disturbance: what all its numbers and figures are computed from."""

from __future__ import annotations

import numpy as np

from fastmech.scene import Scene

PAPER_SCENE = Scene(c2=1100.0 / 3.0)
"""Table 1 with the stiffness c2 = 1100/3 N/m, of which the table prints the rounding 366.67 N/m.

The paper computed with the unrounded value: with it all eight angles of Table 2 and the coefficients of (16)
and (20) come out to the printed digit; with 366.67 N/m five of the eight angles miss their last digit.
"""

STATIC_SCENE = PAPER_SCENE.replace(alpha=0.0)
"""The same under the constant force of 100 N: Tables 2 to 4 and Figures 6 to 11."""

START = (4.0 * np.pi / 13.0, np.pi / 7.0, 0.0, 0.0)
"""Table 1: phi, theta [rad], phi', theta' [rad/s] at t = 0."""

DISTURBANCE = (0.1, 0.0, 0.1, 0.0)
"""Figures 7 to 11: xi_1, xi_2 [rad], eta_1, eta_2 [rad/s]."""
