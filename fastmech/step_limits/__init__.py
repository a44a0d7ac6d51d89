"""How long a step may be: stability functions, limits predicted and measured, warnings before a run."""
