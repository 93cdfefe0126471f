"""Auditor of inflated tubes that are pulled and twisted, within a fit."""

import numpy as np

from .measured import table_of

#: Columns of the file of a tube by the strains of residuals.csv.
COLUMNS = {
    "along the tube": "axial_percent",
    "around the tube": "hoop_percent",
    "radius times twist": "twist_deg_per_m",
}
MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0}


def objective(audit, test, section):
    """Return the sum of the RMS errors of the strains over their largest."""
    errors = [
        float(np.sqrt(np.mean(rows["difference"] ** 2)) / rows["measured"].abs().max())
        for _, rows in audit.blocks[test].groupby("quantity", sort=False)
    ]
    return float(np.mean(errors)) if audit.several else sum(errors)


def audit(audit, test, section, numbers):
    """Audit RMS errors, strains.csv and the tables of one tube."""
    ledger, folder = audit.ledger, audit.folder
    matched = audit.blocks[test]
    strains = dict(iter(matched.groupby("quantity", sort=False)))
    index = matched.index.to_numpy()
    rows = np.concatenate([np.arange(1, 1 + len(table)) for table in strains.values()])
    ledger.column("residuals.csv", "row", rows, rows=index)
    ledger.claim_column("residuals.csv", "measured", "consistent", rows=index)
    file = f"{test}-strains.csv" if audit.several else "strains.csv"
    for column in folder.data(file):
        ledger.column(file, column, matched[column].to_numpy(), "consistent")
    errors = {
        name: float(np.sqrt(np.mean(table["difference"] ** 2))) for name, table in strains.items()
    }
    if list(numbers["rms_percent"]) != list(errors):
        ledger.find(f"result.json: tests.{test}.rms_percent", f"is not of {list(errors)}")
    for name, error in errors.items():
        ledger.json(("tests", test, "rms_percent", name), error, rel=1e-6)
    for name, table in strains.items():
        strain = strain_of_file(audit, section, name)
        if not np.allclose(strain - strain.mean(), table["measured"], atol=1e-6):
            ledger.find(f"residuals.csv: {test}, {name}", "is not that of the file")
    tubes = [name for name in audit.result["tests"] if audit.kind_of(name)[0] == "tube"]
    ledger.table(
        "Misfit of the tube",
        ["strain", "RMS error, %"],
        [list(item) for item in errors.items()],
        "recomputed",
        number=tubes.index(test),
        slack=1e-6,
    )
    each = ", ".join(rf"{name} (\S+?)" for name in errors)
    pattern = rf"RMS errors of strain in %: {each}(?=[,;\s]|\.?$)"
    ledger.text(pattern, list(errors.values()), "recomputed", digits=3)


def strain_of_file(audit, section, name):
    """Return a measured strain (rows,) in percent, of twist the shear that it makes."""
    file = audit.folder.project_path.parent / section.get("folder", "") / section["file"]
    strain = table_of(file)[COLUMNS[name]].to_numpy(float)
    if name != "radius times twist":
        return strain
    unit = audit.folder.project.get("units", {}).get("length", "mm")
    metres = 0.5 * section["diameter"] * MM[unit] / 1000.0
    return 100.0 * np.radians(strain) * metres


def largest_shear(audit, section):
    """Return the largest measured shear of a tube, 0 where no twist is measured."""
    try:
        return float(np.abs(strain_of_file(audit, section, "radius times twist")).max()) / 100.0
    except KeyError:
        return 0.0
