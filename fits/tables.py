"""Tables of a result as files: CSV always, Parquet where pyarrow is there."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError
from ..writing import replacing

if TYPE_CHECKING:
    import pandas as pd

CSV, PARQUET = ".csv", ".parquet"


def write_table(table: pd.DataFrame, path: Path | str) -> Path:
    """Write a table into the format that the file's name ends in.

    Numbers of a CSV have nine digits; those of a Parquet file are as they are.

    Raises
    ------
    InputError : neither .csv nor .parquet, or Parquet without pyarrow. OutputError : the file
        cannot be written.
    """
    path = Path(path)
    kind = path.suffix.lower()
    if kind not in (CSV, PARQUET):
        raise InputError(path, "", f"expected a name that ends in {CSV} or {PARQUET}")
    if kind == PARQUET and importlib.util.find_spec("pyarrow") is None:
        problem = "needs pyarrow, which is not installed: pip install 'bubblefit[parquet]'"
        raise InputError(path, PARQUET, f"{problem}, or write a {CSV}")
    with replacing(path) as temporary:
        if kind == PARQUET:
            table.to_parquet(temporary, engine="pyarrow", index=False)
        else:
            table.to_csv(temporary, index=False, float_format="%.9g")
    return path
