from isomatch.transfer.bake import Baked, bake_texture
from isomatch.transfer.carried_landmarks import carry_landmarks
from isomatch.transfer.carry import Carried, carry_attributes
from isomatch.transfer.choices import Labelling, NumbersAs, Side

__all__ = [
    "Baked",
    "Carried",
    "Labelling",
    "NumbersAs",
    "Side",
    "bake_texture",
    "carry_attributes",
    "carry_landmarks",
]
