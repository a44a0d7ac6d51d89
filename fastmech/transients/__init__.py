"""How small disturbances grow: Lyapunov exponents along motions, transient growth at equilibria."""
