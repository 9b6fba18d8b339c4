"""Building blocks of every page: text, tables, figures, and numbers as an engineer reads them."""
