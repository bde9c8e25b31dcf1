"""The panel in the sidebar of the 3D view."""

import textwrap

import bpy

from . import matches, operators

LETTER_WIDTH = 7.5  # pixels across a letter of the interface, at scale 1


class ISOMATCH_PT_panel(bpy.types.Panel):
    """Two objects, their match, and what it is used for."""

    bl_idname = "ISOMATCH_PT_panel"
    bl_label = "isomatch"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = operators.TAB

    def draw(self, context):
        """Show the objects, then what can be done next."""
        layout, settings = self.layout, context.scene.isomatch
        if not operators.is_installed():
            paragraph(layout, context, "isomatch is not installed in Blender's Python.", icon="ERROR")
            layout.operator("isomatch.copy_install", icon="COPYDOWN")
            return
        column = layout.column(align=True)
        column.use_property_split, column.use_property_decorate = True, False
        column.prop(settings, "source")
        column.prop(settings, "target")
        layout.operator("isomatch.swap", icon="FILE_REFRESH")
        self.draw_match(layout, settings)
        found = matches.kept(settings.source, settings.target)
        if found:
            self.draw_outcome(layout, context, settings, found)
            self.draw_use(layout, settings)

    def draw_match(self, layout, settings):
        """Show how to match, or how far it is."""
        box = layout.box()
        job = matches.running
        if job:
            stage, share = job.progress
            box.progress(factor=share, text=f"{stage} {share:.0%}")
            box.operator("isomatch.cancel", icon="X")
            return
        box.prop(settings, "modifiers", text="")
        box.prop(settings, "either_side")
        box.prop(settings, "use_landmarks")
        row = box.row()
        row.enabled = settings.use_landmarks
        row.prop(settings, "hold_landmarks")
        row = box.row()
        row.scale_y = 1.4
        row.operator("isomatch.match", icon="PLAY")
        box.operator("isomatch.load", icon="FILE_FOLDER")

    def draw_outcome(self, layout, context, settings, found):
        """Show how the match ended, and what that means."""
        box = layout.box()
        outcome = found.result.outcome
        box.label(text=outcome.value.capitalize(), icon="ERROR" if outcome.is_doubtful else "CHECKMARK")
        paragraph(box, context, outcome.advice)
        row = box.row(align=True)
        row.prop(settings, "show", expand=True)
        box.operator("isomatch.show", icon="COLOR")
        box.operator("isomatch.save", icon="FILE_TICK")

    def draw_use(self, layout, settings):
        """Show what can be carried."""
        box = layout.box()
        ends = settings.target, settings.source
        giver, receiver = ends if settings.receiver == "SOURCE" else ends[::-1]
        box.label(text=f"{giver.name} → {receiver.name}", icon="TRACKING_FORWARDS")
        box.row().prop(settings, "receiver", expand=True)
        box.column(align=True).prop(settings, "data")
        if "LANDMARKS" in settings.data:
            box.prop(settings, "replace_landmarks")
        if receiver.data.users > 1:
            box.prop(settings, "own_copy")
        row = box.row()
        row.scale_y = 1.4
        row.operator("isomatch.carry", icon="IMPORT")
        layout.operator("isomatch.morph", icon="SHAPEKEY_DATA")


def paragraph(layout, context, text: str, icon: str = "NONE") -> None:
    """Write a text in as many lines as the sidebar needs."""
    width = context.region.width if context.region else 300
    scale = context.preferences.system.ui_scale
    column = layout.column(align=True)
    column.scale_y = 0.8
    for line in textwrap.wrap(text, max(20, int(width / (LETTER_WIDTH * scale)) - 4)):
        column.label(text=line, icon=icon)
        icon = "NONE" if icon == "NONE" else "BLANK1"


def register() -> None:
    """Add the panel."""
    bpy.utils.register_class(ISOMATCH_PT_panel)


def unregister() -> None:
    """Undo `register`."""
    bpy.utils.unregister_class(ISOMATCH_PT_panel)
