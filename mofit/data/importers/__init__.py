"""Files of test rigs into campaigns, as a map file describes them (see docs/campaigns.md)."""
