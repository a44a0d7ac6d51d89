"""The paper's mechanism in closed form: physics, counting theorem, stability, folds, sheets, capture.

Formulas that kernels and NumPy share (paper, equations (2)-(16)), and what is proved faster with them than
for any mechanism. Code elsewhere asks the model and names neither its angles nor its parameters.
"""
