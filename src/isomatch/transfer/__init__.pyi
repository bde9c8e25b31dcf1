from isomatch.transfer.carry import Carried, carry_attributes
from isomatch.transfer.choices import Labelling, Side

__all__ = ["Carried", "Labelling", "Side", "carry_attributes"]
