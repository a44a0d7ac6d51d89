"""Basin maps: which resting position each initial state ends in, with proof, and how long that takes."""
