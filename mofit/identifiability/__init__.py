"""Which test tells what: procedures compared by what they can identify, and which test to run next."""
