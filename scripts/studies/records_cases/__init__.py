"""The cases of the study of records: per file a model or two, the tests, and what is wanted of them."""
