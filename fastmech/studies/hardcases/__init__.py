"""A gallery of hard cases: what makes each hard, an oracle from outside, and what must happen."""
