"""Read two vendors' exports, register, fit, plot and export, as a user would."""

import bubblefit as bf

pressures = [0.03, 0.06, 0.1]
tests: list[bf.Bubble] = []
for name, files in {"vic": "vic_*.csv", "davis": "davis_*.txt"}.items():
    table = bf.read(files, of="bubble")
    print(name, len(table), "rows")
    found = bf.register(table, None, pressures, radius=100.0, elements=60, name=name)
    print(found)
    tests.append(found.bubble)
law = bf.Law("constant", bounds={"E1": [20, 2000], "E2": [20, 1000], "G12": [1, 200]})
fabric = bf.Fabric("VALMEX 7318", thickness=0.8)
fit: bf.Fit = bf.fit(tests, law, fabric=fabric, starts=1, jobs=1, weights={"vic": 2.0}, out="out")
fit.plot_moduli().save("moduli.png")
fit.card.export("abaqus-umat", "card")
project = bf.Project.of(tests, law, fabric=fabric, starts=1)
same: bf.Project = bf.read_project(project.to_toml("project.toml"))
assert list(same.tests) == ["vic", "davis"]
