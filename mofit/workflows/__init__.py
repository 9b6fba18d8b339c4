"""Jobs from file to file: identification and diagnosis of one campaign, and batches of many."""
