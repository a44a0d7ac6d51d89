"""The mechanism's physics, once (paper, equations (2)-(16)): formulas that kernels and NumPy share."""
