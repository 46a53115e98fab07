"""Tables of observations, as every kind reads them: columns, rows, dates, what is not used."""
