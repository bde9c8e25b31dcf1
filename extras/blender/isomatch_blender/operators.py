"""What the buttons do. Every error of isomatch is shown in its own words, and nothing is written before."""

import importlib.util
import sys
from pathlib import Path

import bpy
from bpy.props import BoolProperty, StringProperty

from . import matches, meshes
from .job import Job

POLL_SECONDS = 0.1  # seconds between two looks at the match
TAB = "isomatch"


def is_installed() -> bool:
    """Tell whether Blender's Python finds isomatch."""
    return importlib.util.find_spec("isomatch") is not None


def install_command() -> str:
    """Return the command that installs isomatch where Blender looks for modules; the folder of its source is left open.

    numpy is held at the version that Blender brings, for which its own parts are built.
    """
    import numpy

    folder = bpy.utils.user_resource("SCRIPTS", path="modules", create=False)
    return f'"{sys.executable}" -m pip install --target "{folder}" "numpy=={numpy.__version__}" FOLDER_OF_ISOMATCH'


def errors() -> tuple[type[Exception], ...]:
    """Exceptions whose words are for the user."""
    from isomatch import IsomatchError

    return IsomatchError, meshes.Refused


class OfPair:
    """An operator on the two objects that are chosen."""

    @classmethod
    def poll(cls, context):
        """Allow it with two objects, unless a match is under way."""
        settings = context.scene.isomatch
        if not is_installed():
            cls.poll_message_set("isomatch is not installed in Blender's Python")
        elif matches.running is not None:
            cls.poll_message_set("A match is under way")
        elif not (settings.source and settings.target):
            cls.poll_message_set("Choose a source and a target")
        elif settings.source.data == settings.target.data:
            cls.poll_message_set("Source and target are the same mesh")
        else:
            return True
        return False

    def execute(self, context):
        """Do the work in object mode; tell errors in words."""
        settings = context.scene.isomatch
        try:
            with meshes.object_mode(context):
                return self.work(context, settings)
        except errors() as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}

    def tell(self, words: str, notes: list[str]) -> None:
        """Report what was done; as a warning if something is to be known of it."""
        self.report({"WARNING"} if notes else {"INFO"}, "; ".join([words, *notes]))


class ISOMATCH_OT_match(OfPair, bpy.types.Operator):
    """Find the map from the source to the target, in the background."""

    bl_idname = "isomatch.match"
    bl_label = "Match"
    bl_options = {"UNDO"}  # noqa: RUF012 - so Blender wants it

    def begin(self, context) -> Job:
        """Read both objects, and start the match."""
        settings = context.scene.isomatch
        self.pair = settings.source.name, settings.target.name
        with meshes.object_mode(context):
            order, self.notes = matches.planned(settings.source, settings.target, settings)
        self.keys = settings.source.data.session_uid, settings.target.data.session_uid
        self.with_modifiers = settings.modifiers == "APPLY"
        return Job(*order)

    def end(self, context, job: Job):
        """Keep and show the result of a match that is over."""
        try:
            result = job.result()
        except errors() as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        source, target = map(bpy.data.objects.get, self.pair)
        if not source or not target or (source.data.session_uid, target.data.session_uid) != self.keys:
            self.report({"ERROR"}, "the objects were removed or renamed while they were matched; match again")
            return {"CANCELLED"}
        matches.keep(source, target, result, self.with_modifiers)
        outcome = result.outcome
        words = f"{source.name} → {target.name}: {outcome.value}"
        notes = [*self.notes, *([outcome.advice] if outcome.is_doubtful else [])]
        try:
            with meshes.object_mode(context):
                show(context, matches.Pair.of(source, target), "MAP")
        except errors() as error:
            notes.append(f"not shown: {error}")
        self.tell(words, notes)
        return {"FINISHED"}

    def execute(self, context):
        """Match at once, as scripts do; Blender waits."""
        try:
            job = self.begin(context)
        except errors() as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        job.wait()
        return self.end(context, job)

    def invoke(self, context, event):
        """Match in the background; the user goes on."""
        try:
            self.job = matches.running = self.begin(context)
        except errors() as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.timer = context.window_manager.event_timer_add(POLL_SECONDS, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        """Show how far it is; take the result, or give up with Esc."""
        job = self.job
        if event.type == "ESC" and event.value == "PRESS":
            job.cancel()
        elif event.type == "TIMER" and not job.cancelled:
            stage, share = job.progress
            context.workspace.status_text_set(f"isomatch: {stage} {share:.0%} — Esc to cancel")
            redraw(context)
        if job.is_running and not job.cancelled:
            return {"PASS_THROUGH"}
        self.leave(context)
        return {"CANCELLED"} if job.cancelled else self.end(context, job)

    def cancel(self, context):
        """Give up; Blender calls this when it ends the operator."""
        self.job.cancel()
        self.leave(context)

    def leave(self, context):
        """Clear away what `invoke` made."""
        matches.running = None
        context.window_manager.event_timer_remove(self.timer)
        context.workspace.status_text_set(None)
        redraw(context)


def redraw(context) -> None:
    """Draw the sidebars again."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


def show(context, pair: matches.Pair, what: str) -> None:
    """Write the colours, and let solid views show them."""
    pair.show(what)
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D" and area.spaces.active.shading.type == "SOLID":
                area.spaces.active.shading.color_type = "VERTEX"


class ISOMATCH_OT_cancel(bpy.types.Operator):
    """Give up the match that is under way."""

    bl_idname = "isomatch.cancel"
    bl_label = "Cancel"

    @classmethod
    def poll(cls, context):
        """Allow it during a match."""
        return matches.running is not None

    def execute(self, context):
        """Let the match end."""
        matches.running.cancel()
        return {"FINISHED"}


class ISOMATCH_OT_swap(bpy.types.Operator):
    """Exchange source and target."""

    bl_idname = "isomatch.swap"
    bl_label = "Swap"
    bl_options = {"UNDO"}  # noqa: RUF012

    def execute(self, context):
        """Exchange them."""
        settings = context.scene.isomatch
        settings.source, settings.target = settings.target, settings.source
        return {"FINISHED"}


class ISOMATCH_OT_show(OfPair, bpy.types.Operator):
    """Show the map in a colour attribute of both meshes, or how sure it is on the source."""

    bl_idname = "isomatch.show"
    bl_label = "Show"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    def work(self, context, settings):
        """Write the colours."""
        show(context, matches.Pair.of(settings.source, settings.target), settings.show)
        return {"FINISHED"}


class ISOMATCH_OT_carry(OfPair, bpy.types.Operator):
    """Carry the chosen data from one object to the other. What has the same name there is replaced."""

    bl_idname = "isomatch.carry"
    bl_label = "Carry"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    def work(self, context, settings):
        """Carry it, into a copy of the mesh if that is shared and the others are to stay."""
        pair = matches.Pair.of(settings.source, settings.target)
        receiver = settings.source if settings.receiver == "SOURCE" else settings.target
        notes = []
        if receiver.data.users > 1 and settings.own_copy:
            receiver.data = receiver.data.copy()
            matches.keep(pair.source, pair.target, pair.result, pair.with_modifiers)
        elif receiver.data.users > 1:
            notes.append(f"the mesh of {receiver.name} has {receiver.data.users} users, and all show it")
        done, more = pair.carry(settings.receiver, frozenset(settings.data), settings.replace_landmarks)
        self.tell(f"{receiver.name} has got {', '.join(done) or 'nothing'}", notes + more)
        return {"FINISHED"}


class ISOMATCH_OT_morph(OfPair, bpy.types.Operator):
    """Bend the source onto the target, as a shape key of the source."""

    bl_idname = "isomatch.morph"
    bl_label = "Target as Shape Key"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    def work(self, context, settings):
        """Make the shape key."""
        key = matches.Pair.of(settings.source, settings.target).morph()
        self.tell(f"{settings.source.name} has the shape key {key.name}", [])
        return {"FINISHED"}


class OfFile(OfPair):
    """An operator that asks for the file of a map."""

    filepath: StringProperty(subtype="FILE_PATH")
    filter_glob: StringProperty(default="*.npz", options={"HIDDEN"})

    def invoke(self, context, event):
        """Ask for the file."""
        if not self.filepath:
            self.filepath = "map.npz"
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}


class ISOMATCH_OT_save(OfFile, bpy.types.Operator):
    """Save the map and all that is known of it, to load it again or to use it outside of Blender."""

    bl_idname = "isomatch.save"
    bl_label = "Save Map"
    check_existing: BoolProperty(default=True, options={"HIDDEN"})

    def work(self, context, settings):
        """Write the file."""
        pair = matches.Pair.of(settings.source, settings.target)
        pair.result.save(Path(bpy.path.abspath(self.filepath)).with_suffix(".npz"))
        return {"FINISHED"}


class ISOMATCH_OT_load(OfFile, bpy.types.Operator):
    """Load the map of these two meshes that was saved before."""

    bl_idname = "isomatch.load"
    bl_label = "Load Map"
    bl_options = {"UNDO"}  # noqa: RUF012

    def work(self, context, settings):
        """Read the file, and refuse the map of other meshes."""
        from isomatch import MatchResult

        source, target = settings.source, settings.target
        result = MatchResult.load(bpy.path.abspath(self.filepath))
        with_modifiers = settings.modifiers == "APPLY"
        pair = matches.Pair(source, target, result, with_modifiers)
        result.map.check_fits(*(matches.surface_of(pair.asset(obj)) for obj in (source, target)))
        matches.keep(source, target, result, with_modifiers)
        show(context, pair, "MAP")
        return {"FINISHED"}


class ISOMATCH_OT_copy_install(bpy.types.Operator):
    """Copy the command that installs isomatch into Blender's Python, for a terminal."""

    bl_idname = "isomatch.copy_install"
    bl_label = "Copy Install Command"

    def execute(self, context):
        """Copy it."""
        context.window_manager.clipboard = install_command()
        self.report(
            {"INFO"}, "copied: run it in a terminal with the folder of isomatch, then start Blender again"
        )
        return {"FINISHED"}


CLASSES = (
    ISOMATCH_OT_match,
    ISOMATCH_OT_cancel,
    ISOMATCH_OT_swap,
    ISOMATCH_OT_show,
    ISOMATCH_OT_carry,
    ISOMATCH_OT_morph,
    ISOMATCH_OT_save,
    ISOMATCH_OT_load,
    ISOMATCH_OT_copy_install,
)


def register() -> None:
    """Add the operators."""
    for each in CLASSES:
        bpy.utils.register_class(each)


def unregister() -> None:
    """Undo `register`."""
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
