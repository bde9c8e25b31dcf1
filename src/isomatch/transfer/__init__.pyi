from isomatch.transfer.bake import Baked as Baked
from isomatch.transfer.bake import bake_texture as bake_texture
from isomatch.transfer.carried_landmarks import carry_landmarks as carry_landmarks
from isomatch.transfer.carry import Carried as Carried
from isomatch.transfer.carry import carry_attributes as carry_attributes
from isomatch.transfer.choices import Labelling as Labelling
from isomatch.transfer.choices import NumbersAs as NumbersAs
from isomatch.transfer.choices import Side as Side
