"""What serves study: sets, damage, other methods, evaluation and the paper, made of public names of isomatch."""
