"""The live explorer: a page on this machine on which a mechanism is dragged and everything follows."""
