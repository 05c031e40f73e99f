"""From a laboratory's file to an experiment: table, columns, units, cycles, signs, and what is strange about it."""
