from isomatch.transfer.carry import Carried, Labelling, Side, carry_attributes

__all__ = ["Carried", "Labelling", "Side", "carry_attributes"]
