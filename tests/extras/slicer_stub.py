"""A stand-in for the parts of 3D Slicer that the module uses: nodes hold real VTK data, widgets are mocks.

Names and meanings are those of Slicer's sources; nothing here was compared with a running Slicer.
"""

import sys
from types import ModuleType, SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import vtk


class TransformNode:
    """A linear transform, whose matrix leads to the coordinates of its parent, here the world."""

    def __init__(self, matrix):
        self.matrix = np.asarray(matrix, dtype=float)

    @staticmethod
    def GetTransformBetweenNodes(first, second, transform):
        to_world, from_world = (
            np.eye(4) if node is None else each(node.matrix)
            for node, each in ((first, np.array), (second, np.linalg.inv))
        )
        transform.Identity()
        transform.Concatenate((from_world @ to_world).ravel().tolist())


class Node:
    """What all nodes have."""

    def __init__(self, name, transform=None):
        self.name, self.transform = name, transform

    def GetName(self):
        return self.name

    def GetClassName(self):
        return self.kind

    def GetParentTransformNode(self):
        return self.transform


class ModelNode(Node):
    kind = "vtkMRMLModelNode"

    def __init__(self, name, data=None, transform=None):
        super().__init__(name, transform)
        self.data, self.display = data, None

    def GetPolyData(self):
        return self.data

    def SetAndObservePolyData(self, data):
        self.data = data

    def GetDisplayNode(self):
        return self.display

    def CreateDefaultDisplayNodes(self):
        self.display = MagicMock()


class MarkupsNode(Node):
    """Control points: [label, position in the world or None, description]."""

    PositionUndefined, PositionPreview, PositionDefined, PositionMissing = range(4)

    def __init__(self, name, kind="vtkMRMLMarkupsFiducialNode", points=()):
        super().__init__(name)
        self.kind = kind
        self.points = [[label, position, ""] for label, position in points]

    def GetNumberOfControlPoints(self):
        return len(self.points)

    def GetNthControlPointLabel(self, i):
        return self.points[i][0]

    def GetNthControlPointPositionStatus(self, i):
        return self.PositionUndefined if self.points[i][1] is None else self.PositionDefined

    def GetNthControlPointPositionWorld(self, i, world):
        world[:] = self.points[i][1]

    def AddControlPointWorld(self, position, label=""):
        self.points.append([label, [position[k] for k in range(3)], ""])
        return len(self.points) - 1

    def UnsetNthControlPointPosition(self, i):
        self.points[i][1] = None

    def SetNthControlPointDescription(self, i, text):
        self.points[i][2] = text


class Scene:
    """Makes nodes."""

    def AddNewNodeByClass(self, kind, name=""):
        return ModelNode(name) if kind == ModelNode.kind else MarkupsNode(name, kind)

    def Clear(self):
        pass


class Base:
    """A base class of scripted modules."""

    def __init__(self, parent=None):
        self.parent = parent or MagicMock()
        self.layout = MagicMock()

    def setup(self):
        pass


def installed():
    """Put the stand-ins where `import` finds them; return those that were put, by name."""
    slicer = ModuleType("slicer")
    slicer.mrmlScene, slicer.app, slicer.util = Scene(), MagicMock(), MagicMock()
    slicer.qMRMLNodeComboBox = MagicMock
    slicer.vtkMRMLTransformNode, slicer.vtkMRMLMarkupsNode = TransformNode, MarkupsNode
    slicer.vtkMRMLDisplayNode = SimpleNamespace(UseManualScalarRange=0, UseDirectMapping=4)
    base = ModuleType("slicer.ScriptedLoadableModule")
    for name in ("", "Widget", "Logic", "Test"):
        setattr(base, f"ScriptedLoadableModule{name}", type(f"ScriptedLoadableModule{name}", (Base,), {}))
    slicer.ScriptedLoadableModule = base
    made = {"slicer": slicer, "slicer.ScriptedLoadableModule": base, "qt": MagicMock(), "ctk": MagicMock()}
    sys.modules.update(made)
    assert vtk.VTK_VERSION
    return made
