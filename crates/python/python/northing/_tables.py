"""Columns as tables: pandas, polars, and whoever reads Arrow."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from . import _northing

if TYPE_CHECKING:
    import pandas
    import polars


class Table:
    """Columns with the unit in every name."""

    def to_dict(self) -> dict[str, Any]:
        """The columns by name."""
        raise NotImplementedError

    def to_pandas(self) -> pandas.DataFrame:
        """As a DataFrame of pandas; NaN where there is nothing to say."""
        import pandas

        frame: pandas.DataFrame = pandas.DataFrame(self.to_dict())
        return frame

    def to_polars(self) -> polars.DataFrame:
        """As a DataFrame of polars; null where there is nothing to say."""
        import polars

        return polars.DataFrame(self)

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        """The columns as a stream of Arrow (PyCapsule interface); null where there is nothing to say."""
        return _northing.arrow_stream(self.to_dict())
