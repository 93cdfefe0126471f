"""The cubic laws that the thesis identified: tables 3.2 and 4.2."""

#: GPa, of the strips of chapter 3.
TABLE_3_2 = [
    -7.96599e-3, 7.49311e-1, -1.50931e-1, 2.05148e-2,
    -1.13743e1, 1.07160e1, -6.17621e-1, 1.41287e-1,
    -4.78030e2, 2.11227e2, -2.02600e1, 8.15340e-1,
]  # fmt: skip
#: GPa, the known solution of the bubbles, "solution".
TABLE_4_2 = [
    -7.96788e-3, 7.10747e-1, -1.56912e-1, 2.00439e-2,
    -1.06241e1, 1.37830e1, -9.31830e-1, 1.39437e-1,
    -4.79622e2, 2.12650e2, -2.02028e1, 8.06350e-1,
]  # fmt: skip
