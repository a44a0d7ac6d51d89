"""Every resting position of a scene, with a proof that none is missing, for one scene or over a grid."""
