"""Solvers that fail in earnest, for the tests of what every command then says."""

#: What a shell does around the real ccx, by fault. The deck is `job.inp`, its mesh `mesh.inp`.
#: Inside out: two corners of the first element change places. Collapse: no increment may be
#: shorter than 0.9, and none is good enough.
CALCULIX = {
    "inside out": r"""
awk -F, 'seen==1 && NF>4 {print $1","$3","$2 substr($0, length($1","$2","$3)+1); seen=2; next}
         /^\*ELEMENT/ && !seen {seen=1} {print}' OFS=, mesh.inp > turned && mv turned mesh.inp
exec REAL "$@" """,
    "killed": 'REAL "$@" & kill -9 $!; kill -9 $$',
    "time-out": "echo $$ > FOLDER/pids; exec sleep 1000",
    "disk full": 'ulimit -f 8; exec REAL "$@"',
    "collapse": r"""
sed -i -e '/^\*STATIC/{n;s/^[^,]*, *\([^,]*\).*/1, \1, 0.9, 1/}' \
    -e '/^\*CONTROLS, *PARAMETERS=FIELD/{n;s/.*/1e-30, 1e-30/}' job.inp
exec REAL "$@" """,
    # A whole run whose last increment counts as one that did not converge.
    "collapse late": """
REAL "$@"; sed -i '$d' job.sta; echo " *ERROR: increment size smaller than minimum"; exit 201""",
}
#: The stand-in's own faults.
MARC = {
    "inside out": "inside out", "killed": "killed", "time-out": "hanging", "disk full": "disk full",
    "no licence": "licence", "collapse": "3015",
}  # fmt: skip


def failing_ccx(folder, real):
    """A ccx that fails as the file `fault` beside it says, and tells its runs to `runs`.

    Those whose number is not in the file `good`.
    """
    path = folder / "ccx"
    cases = "".join(
        f"'{name}')\n{script.replace('REAL', str(real)).replace('FOLDER', str(folder))}\n;;\n"
        for name, script in CALCULIX.items()
    )
    path.write_text(
        f'#!/bin/sh\n[ "$1" = -v ] && exec {real} -v\necho run >> {folder}/runs\n'
        f'grep -qx "$(wc -l < {folder}/runs)" {folder}/good && exec {real} "$@"\n'
        f'case "$(cat {folder}/fault)" in\n{cases}esac\nexec {real} "$@"\n'
    )
    path.chmod(0o755)
    return path
