"""What is known of a found map: evidence, expected errors, quality, questions."""
