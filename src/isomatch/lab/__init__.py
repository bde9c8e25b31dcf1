"""What serves study alone: published sets, damage, other methods, evaluation and the paper. No other room imports it."""
