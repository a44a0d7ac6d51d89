"""Fixed-step methods: tableaus as data, one driver that runs any of them over blocks of lanes."""
