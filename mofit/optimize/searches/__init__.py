"""Global searches: each module is one, named as `--search` names it, with a function ``search`` of one signature."""
