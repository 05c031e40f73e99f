"""A law in a class, as a user writes one in `laws.py`, which imports Material and Parameter.

In a process all tests name that file alike: two classes of one name in different files are refused.
"""

SIMPLE = """class Simple(Material):
    name = "simple-law-of-a-test"
    formula = "C (I1 - 3)"
    source = "this test"
    parameters = (Parameter("C", "half the modulus"),)

    def strain_energy(self, I1, I2, values):
        return values[0] * (I1 - 3)
"""
